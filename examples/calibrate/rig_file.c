#include "calibrate/rig_file.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MOST_ENTRIES 8
#define BLANKS " \t\r\n"

static bool fail(const char *file) {
    cli_error(CLI_FAILED, "%s: %s", file, errno ? strerror(errno) : "write error");
    return false;
}

static char *part_of(const char *path) {
    const size_t size = strlen(path) + sizeof ".part";
    char *name = malloc(size);
    if (name) snprintf(name, size, "%s.part", path);
    return name;
}

/* The entry that the line gives a value to, or -1. */
static int entry_of(const char *line, const struct rig_entry *entries, int count) {
    line += strspn(line, BLANKS);
    const size_t length = strcspn(line, BLANKS "#");
    for (int i = 0; i < count; i++)
        if (*entries[i].text && strlen(entries[i].key) == length && !strncmp(line, entries[i].key, length))
            return i;
    return -1;
}

static void put_entry(const struct rig_entry *entry, FILE *out) {
    fprintf(out, "%s %s\n", entry->key, entry->text);
}

/* False, with errno, when reading failed. */
static bool copy(FILE *in, FILE *out, const struct rig_entry *entries, int count) {
    bool written[MOST_ENTRIES] = {false}, ended = true;
    char *line = NULL;
    size_t capacity = 0;
    while (in && getline(&line, &capacity, in) >= 0) {
        const int entry = entry_of(line, entries, count);
        if (entry < 0) {
            fputs(line, out);
            ended = line[strlen(line) - 1] == '\n';
        } else if (!written[entry]) {
            put_entry(&entries[entry], out);
            written[entry] = ended = true;
        }
    }
    const bool good = !in || !ferror(in);
    free(line);
    if (!ended) fputc('\n', out);
    for (int i = 0; i < count; i++)
        if (*entries[i].text && !written[i]) put_entry(&entries[i], out);
    return good;
}

bool rig_file_update(const char *from, const char *to, const struct rig_entry *entries, int count) {
    const bool standard = strcmp(to, "-") == 0;
    char *part = standard ? NULL : part_of(to);
    FILE *in = fopen(from, "r"), *out = stdout;
    bool good = in || errno == ENOENT;
    if (!good) fail(from);
    if (good && !standard) {
        out = part ? fopen(part, "w") : NULL;
        if (!out) good = fail(to);
    }
    if (good && !copy(in, out, entries, count)) good = fail(from);
    if (in) fclose(in);
    if (standard) {
        if (good && (fflush(out) || ferror(out))) good = fail("standard output");
    } else if (out && out != stdout) {
        errno = 0;
        const bool whole = !ferror(out) && !fflush(out) && !fsync(fileno(out));
        const bool closed = !fclose(out);
        if (good && (!whole || !closed || rename(part, to))) good = fail(to);
        if (!good) unlink(part);
    }
    free(part);
    return good;
}

bool rig_file_can_write(const char *to) {
    if (strcmp(to, "-") == 0) return true;
    char *part = part_of(to);
    FILE *probe = part ? fopen(part, "w") : NULL;
    if (!probe) {
        cli_error(CLI_FAILED, "%s: can't be written there (%s); --output names another place", to,
                  strerror(errno));
    } else {
        fclose(probe);
        unlink(part);
    }
    free(part);
    return probe != NULL;
}
