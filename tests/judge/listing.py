"""The lists of tests/judge: recordings and runs, as plain text with a shorthand for many lines that differ in a word."""
import itertools
import re

BRACES = re.compile(r"\{([^{}]*(?:,|\.\.)[^{}]*)\}")
ANY = "*"  # in place of a name and of its recording: each recording of a folder of one's own


class Wrong(Exception):
    """A list isn't as it should be; the text says where and why."""


class Run:
    def __init__(self, name, recording, options, short):
        self.name, self.recording, self.options, self.short = name, recording, options, short
        self.case = name.split("@")[0]


def choices(text):
    """a,b,c or 1..5."""
    ends = re.fullmatch(r"(\d+)\.\.(\d+)", text)
    return [str(n) for n in range(int(ends[1]), int(ends[2]) + 1)] if ends else text.split(",")


def expand(words):
    """The lines that a line with braces in its first word stands for; lists of words."""
    name = words[0]
    lists = [choices(found) for found in BRACES.findall(name)]
    for chosen in itertools.product(*lists):
        each = iter(chosen)
        line = [BRACES.sub(lambda _: next(each), name)]
        for word in words[1:]:
            for place, choice in enumerate(chosen, 1):
                word = word.replace("{%d}" % place, choice)
            line.append(word)
        yield line


def lines(path):
    """Lists of words, and where they stand."""
    with open(path) as file:
        for number, line in enumerate(file, 1):
            words = line.split("#")[0].split()
            if not words:
                continue
            where = f"{path}:{number}"
            for expanded in expand(words):
                if len(expanded) < 2 or re.search(r"\{\d+\}", " ".join(expanded)):
                    raise Wrong(f"{where}: a name and more words are expected, and {{N}} only for what the name lists")
                yield where, expanded


def read_runs(path):
    runs = {}
    for where, (name, recording, *options) in lines(path):
        short = name.startswith("+")
        name = name.lstrip("+")
        if name in runs:
            raise Wrong(f"{where}: {name} is there twice")
        runs[name] = Run(name, recording, options, short)
    return list(runs.values())


def of_own(runs, names):
    """The runs meant for any recording, for each of these."""
    return [Run(run.name.replace(ANY, name), name, run.options, run.short)
            for name in names for run in runs if run.recording == ANY]


def read_recordings(path):
    found = {}
    for where, (name, *how) in lines(path):
        if name in found:
            raise Wrong(f"{where}: {name} is there twice")
        if how[0] not in ("given", "simulate", "render") or len(how) < 2:
            raise Wrong(f"{where}: given FOLDER, simulate SCENE or render MOTION is expected")
        found[name] = how
    return found
