#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many machines for how many people, and what would break first: writes the tables of
docs/CAPACITY.md from measured figures, by simulating a day's busiest hour event by event.

usage: capacity.py [--check | NAME=VALUE...]    --check only compares; with other figures the page goes
                                                to standard output; capacity.py --help lists NAMEs

An assessment goes: accepted (a transaction) -> waits, clinics before studies -> claimed (a
transaction) -> solved on one core -> stored (a transaction, with its field) -> read. Transactions
of one machine that wait together share a commit; the machines take turns, one commit at a time
(docs/decisions/0014-a-store-for-many-machines.md). Time is in seconds.
"""
import heapq
import math
import random
import re
import sys
from collections import deque
from pathlib import Path

PAGE = Path(__file__).resolve().parent / "CAPACITY.md"

# name: (value, unit, what it is and where it comes from)
FIGURES = {
    "solve_s": (5.0, "CPU s", "one standard solve, rounded up; the slower machine of "
                             "PERFORMANCE.md has a median of 4.2, the faster one of 1.3"),
    "solve_spread": (0.35, "", "standard deviation over mean of solves; the sides of Table 2"),
    "commit_ms": (2.0, "ms", "one group commit of the database with its disk; assumed, `pg_test_fsync` measures it"),
    "group": (64, "", "transactions of one machine that share a commit at most; server/store/store_postgresql.c"),
    "transaction_ms": (0.5, "ms", "work of the database for a transaction while the others wait; 1 000 assessments a "
                                  "second, each with its audit row, by `bench_fleet.py`"),
    "transactions": (4, "", "of an assessment: accepted, claimed, stored, audited"),
    "reads": (20, "", "requests that read an assessment, its events and pages; assumed"),
    "read_ms": (0.02, "ms", "a read by the daemon; 57 000 a second by `bench_service.py`"),
    "store_kB": (25, "kB", "an assessment in the store, its field included; 12 sides of Table 2"),
    "cores": (16, "", "cores of a machine, one left for the daemon"),
    "wait_s": (10, "s", "longest wait that a clinic accepts for 19 in 20, before the solve itself"),
    "lease_s": (7, "s", "after which the solves of a machine that died are somebody else's; 5.1 s to 6.9 s by "
                        "`cut_network.py`"),
    "core_hour": (0.04, "EUR", "a core for an hour, rented; assumed"),
    "GB_month": (0.12, "EUR", "a GB of the store for a month, with its copies; assumed"),
}
# A day's sides, and the part of them in the busiest hour: clinics work by day.
BUSIEST = 0.2
PLACES = (
    ("a clinic", 40),
    ("a hospital", 400),
    ("a group of ten hospitals", 4000),
    ("a country, 1 000 hospitals", 400000),
)
SIMULATED_ENDS = 40000  # the busiest hour is cut when so many have come


def percentile(values, part):
    """Of what is left when the first tenth, the warming up, is gone."""
    values = sorted(values[len(values) // 10:])
    return values[min(len(values) - 1, int(part * len(values)))] if values else 0.0


class Database:
    """Group commit, one machine's group after another's: what a machine has waiting when its turn
    comes makes up its group."""

    def __init__(self, plan, figures):
        self.plan, self.figures = plan, figures
        self.waiting, self.turns = {}, deque()  # of each machine; machines with something to write
        self.busy, self.busy_s, self.waits = False, 0.0, []

    def ask(self, now, machine, then):
        queue = self.waiting.setdefault(machine, deque())
        if not queue:
            self.turns.append(machine)
        queue.append((now, then))
        if not self.busy:
            self.commit(now)

    def commit(self, now):
        self.busy = bool(self.turns)
        if not self.turns:
            return
        machine = self.turns.popleft()
        queue = self.waiting[machine]
        batch = [queue.popleft() for _ in range(min(len(queue), int(self.figures["group"])))]
        if queue:
            self.turns.append(machine)
        took = (self.figures["commit_ms"] + len(batch) * self.figures["transaction_ms"]) / 1e3
        self.busy_s += took
        self.plan(now + took, self.committed, batch)

    def committed(self, now, batch):
        for asked, then in batch:
            self.waits.append(now - asked)
            then(now)
        self.commit(now)


class Hour:
    """Sides come in pairs, at random; `workers` cores solve them; `dies` machines go in the middle
    and give their solves back a lease later."""

    def __init__(self, figures, sides_per_hour, workers, dies=0, seed=1):
        self.figures, self.random = figures, random.Random(seed)
        per_machine = int(figures["cores"] - 1)
        self.machines = max(1, math.ceil(workers / per_machine))
        self.free = deque(i // per_machine for i in range(workers))  # whose each free core is
        self.pair_rate = sides_per_hour / 2 / 3600
        self.events, self.count = [], 0
        self.database = Database(self.plan, figures)
        self.queue, self.queue_waits, self.ends, self.arrived = deque(), [], 0, 0
        self.end_s = min(3600.0, SIMULATED_ENDS / max(sides_per_hour / 3600, 1e-9))
        spread = self.figures["solve_spread"]
        self.sigma = math.sqrt(math.log(1 + spread * spread))
        self.mu = math.log(figures["solve_s"]) - self.sigma ** 2 / 2
        self.dying = set(range(dies))
        self.dead, self.solving, self.now = set(), {}, 0.0

    def plan(self, at, what, *arguments):
        self.count += 1
        heapq.heappush(self.events, (at, self.count, what, arguments))

    def run(self):
        self.plan(0.0, self.arrive)
        if self.dying:
            self.plan(self.end_s / 2, self.machine_dies)
        while self.events:
            self.now, _, what, arguments = heapq.heappop(self.events)
            if self.now > self.end_s:
                break
            what(self.now, *arguments)
        return self

    def arrive(self, now):
        for _ in range(2):
            self.arrived += 1
            machine = self.random.randrange(self.machines)
            self.database.ask(now, machine, self.accepted)
            for _ in range(int(self.figures["transactions"]) - 3):
                self.database.ask(now, machine, lambda _: None)
        self.plan(now + self.random.expovariate(self.pair_rate), self.arrive)

    def accepted(self, now):
        self.queue.append(now)
        self.claim(now)

    def claim(self, now):
        while self.free and self.queue:
            machine, since = self.free.popleft(), self.queue.popleft()
            self.database.ask(now, machine, lambda at, m=machine, s=since: self.claimed(at, m, s))

    def claimed(self, now, machine, since):
        self.queue_waits.append(now - since)
        self.plan(now + self.random.lognormvariate(self.mu, self.sigma), self.solved, machine)
        self.solving[machine] = self.solving.get(machine, 0) + 1

    def solved(self, now, machine):
        if machine in self.dead:
            return
        self.solving[machine] -= 1
        self.database.ask(now, machine, lambda at: self.stored(at, machine))

    def stored(self, now, machine):
        self.ends += 1
        if machine not in self.dead:
            self.free.append(machine)
        self.claim(now)

    def machine_dies(self, now):
        """Its cores are gone at once."""
        self.dead = self.dying
        self.free = deque(machine for machine in self.free if machine not in self.dead)
        for machine in self.dead:  # what they solved waits again when the lease is over
            for _ in range(self.solving.get(machine, 0)):
                self.plan(now + self.figures["lease_s"], self.accepted)

    def wait_s(self, part=0.95):
        return percentile(self.queue_waits, part)

    def database_load(self):
        return self.database.busy_s / self.end_s


def fewest_machines(figures, sides_per_hour):
    """So that 19 in 20 wait no longer than asked, also in the hour in which a machine dies: one
    more than needed, and two at least."""
    per_machine = int(figures["cores"] - 1)
    machines = max(1, int(sides_per_hour * figures["solve_s"] / 3600 / per_machine))
    while Hour(figures, sides_per_hour, machines * per_machine).run().wait_s() > figures["wait_s"]:
        machines += max(1, machines // 20)
    return max(2, machines + 1)


def places_table(figures):
    lines = [f"| for | sides a day | in the busiest hour | machines of {figures['cores']:.0f} cores "
             "| 19 in 20 wait at most | with a machine dying | database busy | store a year | rent a month |",
             "|---|---|---|---|---|---|---|---|---|"]
    for name, sides in PLACES:
        hour = sides * BUSIEST
        machines = fewest_machines(figures, hour)
        workers = machines * int(figures["cores"] - 1)
        usual = Hour(figures, hour, workers).run()
        bad = Hour(figures, hour, workers, dies=1).run()
        stored_GB = sides * 365 * figures["store_kB"] / 1e6
        rent = machines * figures["cores"] * 730 * figures["core_hour"] + stored_GB * figures["GB_month"]
        lines.append(f"| {name} | {sides} | {hour:.0f} | {machines} | {usual.wait_s():.1f} s "
                     f"| {bad.wait_s():.1f} s | {percent(usual.database_load())} | {stored_GB:.1f} GB "
                     f"| {rent:.0f} EUR |")
    return lines


def percent(part):
    return f"{100 * part:.1f} %" if part < 0.1 else f"{100 * part:.0f} %"


def break_table(figures):
    """Ever more sides, with ever enough cores: which part is full first?"""
    lines = ["| sides a second | cores solving | database busy | a transaction, 99 in 100 "
             "| reads, cores of all daemons | store a day |", "|---|---|---|---|---|---|"]
    broken = None
    rate = 1.0
    while broken is None and rate < 1e6:
        cores = rate * figures["solve_s"]
        # A busy database holds workers up: a third more cores than the solves alone need.
        hour = Hour(figures, rate * 3600, int(cores * 1.3) + 8).run()
        slow_s = percentile(hour.database.waits, 0.99)
        reads = rate * figures["reads"] * figures["read_ms"] / 1e3
        lines.append(f"| {rate:g} | {cores:.0f} | {percent(hour.database_load())} | {slow_s * 1e3:.0f} ms "
                     f"| {reads:.2f} | {rate * 86400 * figures['store_kB'] / 1e6:.0f} GB |")
        if hour.database_load() > 0.97 or slow_s > 1:
            broken = rate
        rate *= 2
    return lines, broken


def solve_table(figures):
    """What faster solves would change for a country."""
    lines = ["| a solve takes | solves a second and machine | machines for a country | rent a month | "
             "machines until the database is full |", "|---|---|---|---|---|"]
    hour = PLACES[-1][1] * BUSIEST
    per_machine = int(figures["cores"] - 1)
    most = database_limit(figures)
    for solve_s in (2 * figures["solve_s"], figures["solve_s"], figures["solve_s"] / 2.5,
                    figures["solve_s"] / 10, figures["solve_s"] / 50):
        changed = {**figures, "solve_s": solve_s}
        machines = fewest_machines(changed, hour)
        rent = machines * figures["cores"] * 730 * figures["core_hour"]
        lines.append(f"| {solve_s:g} s | {per_machine / solve_s:.1f} | {machines} | {rent:.0f} EUR "
                     f"| {most * solve_s / per_machine:.0f} |")
    return lines


def database_limit(figures):
    """Assessments a second when every commit is full."""
    group = figures["group"]
    a_group_s = (figures["commit_ms"] + group * figures["transaction_ms"]) / 1e3
    return group / a_group_s / figures["transactions"]


def figures_table(figures):
    lines = ["| figure | value | what it is |", "|---|---|---|"]
    for name, value in figures.items():
        _, unit, what = FIGURES[name]
        lines.append(f"| `{name}` | {value:g} {unit} | {what} |".replace("  |", " |"))
    return lines


def page(figures):
    """CAPACITY.md with its tables made anew; what stands between them is left alone."""
    broke, at = break_table(figures)
    limit = database_limit(figures)
    sentence = [f"With these figures the turn to write is never free at {at:g} assessments a second "
                f"({at * figures['solve_s']:.0f} cores that solve), where the simulation stopped; with every "
                f"group full the database would end at about {limit:.0f}."]
    tables = {"figures": figures_table(figures), "places": places_table(figures),
              "break": broke + [""] + sentence, "solves": solve_table(figures)}
    text = PAGE.read_text(encoding="utf-8")
    for name, lines in tables.items():
        pattern = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        text, count = re.subn(pattern, lambda m, t="\n".join(lines): f"{m[1]}{t}\n{m[2]}", text, flags=re.S)
        if count != 1:
            sys.exit(f"{PAGE.name} has {count} places for {name}")
    return text


def usage():
    return "usage: capacity.py [--check | NAME=VALUE...]\n" + "\n".join(
        f"  {name:15} {value:g} {unit}: {what}".replace(" :", ":") for name, (value, unit, what) in FIGURES.items())


def other_figures(words):
    """FIGURES' values with those that the words give."""
    figures = {name: value for name, (value, _, _) in FIGURES.items()}
    for word in words:
        name, _, value = word.partition("=")
        if name not in FIGURES or not re.fullmatch(r"\d+(\.\d+)?", value):
            sys.exit(usage())
        figures[name] = float(value)
    return figures


def main(words):
    if words == ["--help"]:
        print(usage())
    elif words == ["--check"]:
        if page(other_figures([])) != PAGE.read_text(encoding="utf-8"):
            print("docs/CAPACITY.md is not what docs/capacity.py writes: run it")
            return 1
    elif words:
        print(page(other_figures(words)), end="")
    else:
        PAGE.write_text(page(other_figures([])), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
