"""The small wrong changes that a hand makes: each operator turns a line of C or OpenCL C into others that still compile."""
import re

# lines that say something to people, or declare; a change there breaks no behaviour
SPOKEN = re.compile(r'log_message|printf|FATHOM_LOG|perror|^\s*(#|/?\*|//|typedef|extern|struct |enum |case .*return ")|"')
# what only makes it quick, or gives back what is held: nothing that a unit test should see
SILENT = re.compile(r"FETCH_AHEAD|\(void\)|device_unmap|_close\(|free\(|Release|ms_")
STATEMENT = re.compile(r"^\s+(?!return|break|continue|goto|else|case|default)[\w>.\-\[\]+* ()&,]+(=|\+=|-=|\+\+|\().*;\s*$")
DECLARATION = re.compile(r"^\s*(const |static |unsigned |struct )*[a-z_0-9]+ [*a-z_]")

SWAPS = [
    (r"(?<=[\w)\]]) \+ (?=[\w(-])", " - ", "+ to -"),
    (r"(?<=[\w)\]]) - (?=[\w(])", " + ", "- to +"),
    (r"(?<=[\w)\]]) \* (?=[\w(])", " / ", "* to /"),
    (r"(?<=[\w)\]]) / (?=[\w(])", " * ", "/ to *"),
    (r" < (?!<)", " <= ", "< to <="),
    (r" <= ", " < ", "<= to <"),
    (r" > (?!>)", " >= ", "> to >="),
    (r" >= ", " > ", ">= to >"),
    (r" < (?!<)", " > ", "< to >"),
    (r" > (?!>)", " < ", "> to <"),
    (r" == ", " != ", "== to !="),
    (r" != ", " == ", "!= to =="),
    (r" && ", " || ", "&& to ||"),
    (r" \|\| ", " && ", "|| to &&"),
    (r" \+= ", " -= ", "+= to -="),
    (r" -= ", " += ", "-= to +="),
    (r"(?<=[=(,?:] )-(?=[\w(])", "", "a minus dropped"),
    (r"(?<=[ (])!(?=[\w(])", "", "! dropped"),
    (r"\bfmax(f?)\(", r"fmin\1(", "the larger to the smaller"),
    (r"\bfmin(f?)\(", r"fmax\1(", "the smaller to the larger"),
    (r"\[0\]", "[1]", "[0] to [1]"),
    (r"\[2\]", "[1]", "[2] to [1]"),
    (r"(?<=[\w)])\.x\b", ".y", ".x to .y"),
    (r"(?<=[\w)])\.y\b", ".x", ".y to .x"),
    (r" = 0;", " = 1;", "0 to 1"),
    (r" = true;", " = false;", "true to false"),
    (r" = false;", " = true;", "false to true"),
    (r"\b0\.5f?\b", "0.25f", "a half to a quarter"),
    (r"(?<=[ (])2 \* ", "", "twice to once"),
    (r"(?<=[ (])3 \* ", "2 * ", "three to two"),
    (r" \? ([^:?]+) : ([^;?]+)(?=[;,)])", r" ? \2 : \1", "the two of a choice swapped"),
]


def mutations(line):
    """(what, line) of each change to a line; empty where it holds nothing to change. Every place of an operator counts."""
    code = line.split("/*")[0].rstrip()
    if not code.startswith(" ") or SPOKEN.search(code) or SILENT.search(code) or "for (" in code:
        return []
    found = []
    for pattern, text, what in SWAPS:
        for place in re.finditer(pattern, code):
            changed = code[:place.start()] + place.expand(text) + code[place.end():]
            found.append((what, changed + line[len(code):]))
    if STATEMENT.match(code) and not DECLARATION.match(code):
        indent = re.match(r"\s*", code).group()
        found.append(("a statement dropped", f"{indent};"))
    return found
