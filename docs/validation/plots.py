# SPDX-License-Identifier: GPL-3.0-or-later
"""A few plots as plain SVG, without libraries. Colours: Okabe and Ito's, which colour-blind readers
tell apart; every figure also reads in grey."""

import math
import os

BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#6b7280"
INK, FAINT = "#1f2937", "#d9dde3"
FONT = "font-family=\"'DejaVu Sans', Verdana, Arial, sans-serif\""


def escape(text):
    return str(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def ticks(low, high, target=5):
    """Round numbers that cover [low, high] inside."""
    if not high > low:
        high = low + 1
    raw = (high - low) / target
    power = 10 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if m * power >= raw)
    first = math.ceil(low / step - 1e-9)
    return [round(k * step, 10) for k in range(first, int(math.floor(high / step + 1e-9)) + 1)]


def symbol(term):
    """ "eM*muM" and "R2^2" as people write them."""
    return term.replace("mu", "μ").replace("*", "·").replace("^2", "²")


def number(value):
    return f"{value:.10g}"


class Figure:
    def __init__(self, width, height, title):
        self.width, self.height = width, height
        self.parts = [
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
                f'viewBox="0 0 {width} {height}" role="img" {FONT} font-size="12" fill="{INK}">'
            ),
            f"<title>{escape(title)}</title>",
            f'<rect width="{width}" height="{height}" fill="#fff"/>',
        ]

    def add(self, part):
        self.parts.append(part)

    def text(self, x, y, words, size=12, anchor="start", colour=INK, weight="normal", turn=0):
        turned = f' transform="rotate({turn} {x:.1f} {y:.1f})"' if turn else ""
        self.add(
            f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" '
            f'fill="{colour}" font-weight="{weight}"{turned}>{escape(words)}</text>'
        )

    def line(self, x1, y1, x2, y2, colour=INK, width=1.0, dash=None):
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self.add(
            f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" '
            f'stroke-width="{width}"{dashed}/>'
        )

    def rect(self, x, y, width, height, colour, opacity=1.0):
        self.add(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(width, 0):.1f}"'
            f' height="{max(height, 0):.1f}" fill="{colour}" fill-opacity="{opacity}"/>'
        )

    def circle(self, x, y, radius, colour, hollow=False):
        fill = (
            f'fill="#fff" stroke="{colour}" stroke-width="1.6"'
            if hollow
            else f'fill="{colour}" stroke="#fff"'
        )
        self.add(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" {fill}/>')

    def cloud(self, points, colour, size=2.4, opacity=0.45):
        """Many points as one path: a tenth of the bytes."""
        path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)
        self.add(
            f'<path d="{path}" stroke="{colour}" stroke-width="{size}" stroke-linecap="round" '
            f'stroke-opacity="{opacity}" fill="none"/>'
        )

    def curve(self, points, colour, width=2.0, dash=None):
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self.add(
            f'<polyline points="{path}" stroke="{colour}" stroke-width="{width}"'
            f' fill="none"{dashed}/>'
        )

    def legend(self, x, y, entries):
        """entries: (colour, words, kind); kind is "bar", "dot" or "ring"."""
        for colour, words, kind in entries:
            if kind == "bar":
                self.rect(x, y - 9, 11, 11, colour)
            else:
                self.circle(x + 5.5, y - 3.5, 4, colour, hollow=kind == "ring")
            self.text(x + 17, y, words)
            x += 17 + 6.9 * len(words) + 22

    def svg(self):
        return "\n".join([*self.parts, "</svg>", ""])


class Panel:
    """Axes on a part of a figure: x(value) and y(value) give positions."""

    def __init__(self, figure, left, top, width, height, x_range, y_range):
        self.figure = figure
        self.left, self.top, self.width, self.height = left, top, width, height
        self.x_range, self.y_range = x_range, y_range

    def x(self, value):
        low, high = self.x_range
        return self.left + (value - low) / (high - low) * self.width

    def y(self, value):
        low, high = self.y_range
        return self.top + self.height - (value - low) / (high - low) * self.height

    def y_axis(self, label, target=5, grid=True):
        for tick in ticks(*self.y_range, target):
            if grid:
                self.figure.line(
                    self.left, self.y(tick), self.left + self.width, self.y(tick), FAINT
                )
            self.figure.text(self.left - 7, self.y(tick) + 4, number(tick), 11, "end")
        if label:
            self.figure.text(
                self.left - 44, self.top + self.height / 2, label, 12, "middle", turn=-90
            )

    def x_axis(self, label, values=None, target=5, grid=False):
        for tick in values if values is not None else ticks(*self.x_range, target):
            if grid:
                self.figure.line(
                    self.x(tick), self.top, self.x(tick), self.top + self.height, FAINT
                )
            self.figure.line(
                self.x(tick), self.top + self.height, self.x(tick), self.top + self.height + 4
            )
            self.figure.text(
                self.x(tick), self.top + self.height + 17, number(tick), 11, "middle"
            )
        if label:
            self.figure.text(
                self.left + self.width / 2, self.top + self.height + 36, label, 12, "middle"
            )
        self.frame()

    def right_axis(self, label, y_range, colour):
        for tick in ticks(*y_range):
            position = (
                self.top
                + self.height
                - (tick - y_range[0]) / (y_range[1] - y_range[0]) * self.height
            )
            self.figure.text(
                self.left + self.width + 7, position + 4, number(tick), 11, colour=colour
            )
        self.figure.text(
            self.left + self.width + 46,
            self.top + self.height / 2,
            label,
            12,
            "middle",
            colour=colour,
            turn=90,
        )

    def frame(self):
        self.figure.line(
            self.left, self.top + self.height, self.left + self.width, self.top + self.height
        )


def spread(values, zero=False, margin=0.06):
    low, high = min(values), max(values)
    if zero:
        return (0, high * (1 + margin) or 1)
    gap = (high - low) * margin or abs(high) * margin or 1
    return (low - gap, high + gap)


def cohort_bars(rows, title):
    """Like Fig. 3 of the paper: eps_max of each subject and side, the mean contact pressure beside
    it on an axis of its own. rows: (subject, {side: (eps_max, error, pressure) or None})."""
    figure = Figure(940, 400, title)
    prefix = os.path.commonprefix([subject for subject, _ in rows])
    prefix = prefix[: prefix.rfind("-") + 1]
    solved = [v for _, sides in rows for v in sides.values() if v]
    panel = Panel(
        figure, 64, 52, 800, 290, (0, len(rows)), (0, 1.15 * max(v[0] + v[1] for v in solved))
    )
    pressure = (0, 1.15 * max(v[2] for v in solved))
    panel.y_axis("ε_max (engineering shear strain)")
    panel.right_axis("mean contact pressure, kPa", pressure, BLUE)
    for i, (subject, sides) in enumerate(rows):
        for k, side in enumerate(("right", "left")):
            x = panel.x(i + 0.16 + 0.35 * k)
            width = panel.x(0.32) - panel.x(0)
            value = sides.get(side)
            if not value:
                figure.text(
                    x + width / 2, panel.y(0) - 5, "no result", 10, "start", RED, turn=-90
                )
                continue
            eps, error, kPa = value
            figure.rect(
                x, panel.y(eps), width, panel.y(0) - panel.y(eps), GREEN if k == 0 else "#7fcfb4"
            )
            figure.line(
                x + width / 2, panel.y(eps - error), x + width / 2, panel.y(eps + error), INK, 1.4
            )
            height = panel.top + panel.height * (1 - kPa / pressure[1])
            figure.circle(x + width / 2, height, 4, BLUE, hollow=k == 1)
        figure.text(panel.x(i + 0.5), 360, subject[len(prefix) :], 11, "middle")
    panel.frame()
    figure.text(64, 22, title, 14, weight="bold")
    figure.legend(
        64,
        43,
        [
            (GREEN, "ε_max right", "bar"),
            ("#7fcfb4", "ε_max left", "bar"),
            (BLUE, "pressure right", "dot"),
            (BLUE, "pressure left", "ring"),
        ],
    )
    figure.text(464, 386, "subject (thin line: estimated discretisation error)", 12, "middle")
    return figure.svg()


def main_effects(effects, curves, title, label="mean ε_max"):
    """effects: {factor: [(level, mean)]}; curves: {factor: [(value, degree-2 mean)]}."""
    names = list(effects)
    columns = 4
    lines = math.ceil(len(names) / columns)
    figure = Figure(940, 62 + 210 * lines, title)
    y_range = spread(
        [m for e in effects.values() for _, m in e] + [m for c in curves.values() for _, m in c]
    )
    for i, name in enumerate(names):
        levels = effects[name]
        x_range = spread([v for v, _ in levels], margin=0.12)
        panel = Panel(
            figure,
            66 + 220 * (i % columns),
            50 + 210 * (i // columns),
            184,
            140,
            x_range,
            y_range,
        )
        panel.y_axis(label if i % columns == 0 else "", 4)
        panel.x_axis("", [v for v, _ in levels])
        figure.text(panel.left + 92, panel.top + 172, name, 12, "middle", weight="bold")
        if name in curves:
            figure.curve([(panel.x(v), panel.y(m)) for v, m in curves[name]], ORANGE)
        for v, m in levels:
            figure.circle(panel.x(v), panel.y(m), 4, BLUE)
    figure.text(66, 22, title, 14, weight="bold")
    if len(names) % columns:
        x, y = 66 + 220 * (len(names) % columns), 50 + 210 * (lines - 1) + 40
        figure.legend(x, y, [(BLUE, "mean of the solves", "dot")])
        figure.legend(x, y + 24, [(ORANGE, "degree-2 polynomial", "bar")])
    return figure.svg()


def against(panels, title, x_label, y_label, diagonal=False):
    """Scatter plots side by side. panels: (words, [(x, y)], colour)."""
    count = len(panels)
    figure = Figure(80 + 400 * count, 400, title)
    for i, (words, points, colour) in enumerate(panels):
        x_range, y_range = spread([p[0] for p in points]), spread([p[1] for p in points])
        if diagonal:
            x_range = y_range = (min(x_range[0], y_range[0]), max(x_range[1], y_range[1]))
        panel = Panel(figure, 70 + 400 * i, 62, 320, 270, x_range, y_range)
        panel.y_axis(y_label if i == 0 else "")
        panel.x_axis(x_label[i] if isinstance(x_label, (list, tuple)) else x_label)
        if diagonal:
            figure.line(
                panel.x(x_range[0]),
                panel.y(x_range[0]),
                panel.x(x_range[1]),
                panel.y(x_range[1]),
                GREY,
                1.2,
                "5 4",
            )
        many = len(points) > 400
        figure.cloud(
            [(panel.x(x), panel.y(y)) for x, y in points],
            colour,
            2.4 if many else 7,
            0.45 if many else 0.8,
        )
        figure.text(70 + 400 * i, 50, words, 12)
    figure.text(70, 24, title, 14, weight="bold")
    return figure.svg()


def coefficient_bars(terms, series, title):
    """series: (words, colour, {term: theta}); printed values first by habit."""
    figure = Figure(940, 380, title)
    values = [v for _, _, thetas in series for v in thetas.values()]
    panel = Panel(figure, 64, 60, 850, 262, (0, len(terms)), spread(values + [0]))
    panel.y_axis("coefficient θ (per half range)")
    share = 0.8 / len(series)
    for i, term in enumerate(terms):
        for k, (_, colour, thetas) in enumerate(series):
            if term not in thetas:
                continue
            x = panel.x(i + 0.1 + share * k)
            top = min(panel.y(0), panel.y(thetas[term]))
            figure.rect(
                x,
                top,
                panel.x(share * 0.9) - panel.x(0),
                abs(panel.y(thetas[term]) - panel.y(0)),
                colour,
            )
        figure.text(panel.x(i + 0.5), 342, symbol(term), 11, "middle")
    figure.line(64, panel.y(0), 914, panel.y(0))
    figure.text(64, 22, title, 14, weight="bold")
    figure.legend(64, 44, [(colour, words, "bar") for words, colour, _ in series])
    return figure.svg()


def reading_dots(rows, title):
    """rows: (words, distance to Table 3, distance to Table 4, note), nearest first."""
    figure = Figure(940, 96 + 26 * len(rows), title)
    high = 1.08 * max(max(a, b) for _, a, b, _ in rows)
    panel = Panel(figure, 250, 62, 470, 26 * len(rows) - 8, (0, high), (0, 1))
    panel.x_axis("", grid=True)
    for i, (words, first, second, note) in enumerate(rows):
        y = 74 + 26 * i
        figure.text(240, y + 4, words, 12, "end")
        figure.line(panel.x(min(first, second)), y, panel.x(max(first, second)), y, FAINT, 3)
        figure.circle(panel.x(first), y, 5, BLUE)
        figure.circle(panel.x(second), y, 5, RED, hollow=True)
        figure.text(734, y + 4, note, 11, colour=GREY)
    figure.text(24, 22, title, 14, weight="bold")
    figure.legend(
        250, 46, [(BLUE, "Table 3 (degree 1)", "dot"), (RED, "Table 4 (degree 2)", "ring")]
    )
    return figure.svg()
