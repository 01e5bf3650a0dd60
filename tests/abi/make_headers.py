#!/usr/bin/env python3
"""Makes tests/abi/fathom_shorter.h and fathom_longer.h from lib/fathom.h: an older header, whose growing structs lack their
last field (fathom_config all from the log on), and a later one, whose structs have four numbers more. To be run by hand when
a field is added before 0.2 is tagged; afterwards the shorter one stays as it is."""
import re
import subprocess
import sys

EXTRA = "    int64_t later[4];\n"


def declarations(path):
    text = subprocess.run(["cc", "-fpreprocessed", "-dD", "-E", "-P", path], capture_output=True, text=True, check=True).stdout
    return text


def change(text, longer):
    def struct(match):
        body, name = match[1], match[2]
        if not re.match(r"\s*uint32_t struct_size;", body):
            return match[0]
        if longer:
            return "typedef struct {" + body + EXTRA + "} " + name + ";"
        fields = body.rstrip().split(";")[:-1]
        cut = [i for i, field in enumerate(fields) if name == "fathom_config" and "fathom_log log" in field]
        keep = fields[: cut[0] if cut else -1]
        return "typedef struct {" + ";".join(keep) + ";\n} " + name + ";"

    return re.sub(r"typedef struct \{([^{}]*)\} (\w+);", struct, text)


def main():
    text = declarations("lib/fathom.h")
    for name, longer in (("shorter", False), ("longer", True)):
        with open("tests/abi/fathom_%s.h" % name, "w") as out:
            out.write("/* By make_headers.py. */\n" + change(text, longer))


sys.exit(main())
