# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules about words/: the languages say the same, every word is used and gets the values that it
names, and what people read stands nowhere else."""
import json
import re

from source import Finding, line_of

PLACEHOLDER = re.compile(r"\{(\w+)\}")

# Who writes what people read. Other files write for programs and for those who run the service:
# records, FHIR, HL7, CDS, the log, the command line, /docs.
FOR_PEOPLE = (
    "api/case_doc.c", "api/case_fields.c", "api/case_words.c", "api/parameters_doc.c",
    "api/risk.c", "server/cli/section_words.c", "server/http/guard.c",
    "server/http/handle_assessments.c", "server/http/handle_estimates.c",
    "server/http/handle_field.c", "server/http/handle_list.c", "server/http/handle_report.c",
    "server/http/handle_studies.c", "server/http/handle_system.c", "server/http/page.c",
    "server/http/reply.c", "server/http/routes.c", "server/http/submit.c", "solver/case.c",
    "solver/section_svg.c",
)
# What ends in a log, a header or an error of ours; and documents and media types as constants.
FOR_OTHERS = re.compile(r"\b(CHECK|FAIL|LOG_\w+|http_header\w*|_Static_assert|message)\b")
DOCUMENT = re.compile(r'\\":|^"application/')


def languages(tree):
    return {path: json.loads(tree.text(path)) for path in tree.named(".json", rooms=("words/",))}


def c_name(key):
    return "WORD_" + re.sub(r"\W", "_", key).upper()


def languages_say_the_same(tree):
    """English says which words there are, in which order, and which values they name."""
    files = languages(tree)
    english = files.get("words/en.json", {})
    for path, words in files.items():
        if list(words) != list(english):
            odd = sorted(set(words) ^ set(english)) or ["the order"]
            yield Finding(path, 1, f"not the words of words/en.json: {', '.join(odd[:5])}")
        for key in words.keys() & english.keys():
            line = line_of(tree.text(path), tree.text(path).index(f'"{key}"'))
            if set(PLACEHOLDER.findall(words[key])) != set(PLACEHOLDER.findall(english[key])):
                yield Finding(path, line, f"{key} names other values than in English")
            if not words[key].strip() or words[key] != words[key].strip():
                yield Finding(path, line, f"{key} is empty, or begins or ends with a blank")


def used_by_the_page(tree):
    files = tree.named(".ts", ".tsx", rooms=("static/src/",)) + tree.named(
        ".html", rooms=("static/",))
    text = "\n".join(tree.text(f) for f in files)
    literal = set(re.findall(r"""['"`{]([a-zA-Z]\w*(?:\.\w+)+)['"`}|]""", text))
    beginnings = set(re.findall(r"`((?:\w+\.)+)\$\{", text))
    return literal, beginnings


def every_word_is_used(tree):
    literal, beginnings = used_by_the_page(tree)
    code = "\n".join(tree.code(f) for f in tree.c_files(rooms=("api/", "server/")))
    in_c = set(re.findall(r"\bWORD_\w+", code))
    path = "words/en.json"
    for key in languages(tree).get(path, {}):
        if key in literal or c_name(key) in in_c or any(map(key.startswith, beginnings)):
            continue
        yield Finding(path, line_of(tree.text(path), tree.text(path).index(f'"{key}"')),
                      f"nobody says {key}")


def statements(text, code):
    """(position, text, code) of the parts between semicolons and the braces of blocks; those of
    initialisers stay inside."""
    start, level = 0, 0
    for found in re.finditer(r"[;(){}]", code):
        level += (found[0] == "(") - (found[0] == ")")
        if level == 0 and found[0] in ";{}":
            yield start, text[start:found.start()], code[start:found.start()]
            start = found.end()


def values_of(statement):
    """What a statement's WORDS(…) names: word_text("key", …), or a variable named as its value."""
    inside = "".join(re.findall(r"\bWORDS\(((?:[^()]|\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))*)\)",
                                statement))
    named = set(re.findall(r'\bword_\w+\(\s*"(\w+)"', inside))
    flat = re.sub(r"\w+\((?:[^()]|\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))*\)", "", inside)
    return named | set(re.findall(r"\b\w+\b", flat))


def words_get_the_values_that_they_name(tree):
    english = languages(tree).get("words/en.json", {})
    wanted = {c_name(k): set(PLACEHOLDER.findall(text)) for k, text in english.items()}
    for path in tree.c_files(rooms=("api/", "server/")):
        text, code = tree.text(path), tree.code(path)
        for position, statement, bare in statements(text, code):
            words = [w for w in re.findall(r"\bWORD_\w+", bare) if w in wanted]
            if "WORDS(" not in bare or not words:
                continue
            given = values_of(statement)
            asked = set().union(*(wanted[w] for w in words))
            if asked != given:
                line = line_of(text, position + len(statement) - len(statement.lstrip()))
                yield Finding(path, line, f"{words[0]} names {sorted(asked)}, given {sorted(given)}")


def plain(literal):
    """A C string without the markup, formats and attributes in it."""
    text = re.sub(r"\\[nrt]", " ", literal[1:-1]).replace('\\"', '"')
    text = re.sub(r'[\w:-]+="[^"]*("|$)', " ", text)
    return re.sub(r"<[^>]*(>|$)|^[^<]*>", " ", text)


def what_people_read_stands_in_words(tree):
    """Two words in a row in a string of a file that writes for people."""
    pattern = re.compile(r"[A-Za-z\u00c0-\u024f]{2,},? [A-Za-z\u00c0-\u024f]{2,}")
    for path in FOR_PEOPLE:
        if path not in tree.files:
            continue
        text, code = tree.text(path), tree.code(path)
        for position, statement, bare in statements(text, code):
            if FOR_OTHERS.search(bare) or "policy" in bare:
                continue
            for string in re.finditer(r'"(?: *)"', bare):
                literal = statement[string.start():string.end()]
                if pattern.search(plain(literal)) and not DOCUMENT.search(literal):
                    yield Finding(path, line_of(text, position + string.start()),
                                  f"{literal[:60]} belongs into words/")


WORDS_RULES = (languages_say_the_same, every_word_is_used, words_get_the_values_that_they_name,
               what_people_read_stands_in_words)
