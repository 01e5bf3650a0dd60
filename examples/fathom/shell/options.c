#include "fathom/shell/options.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/help.h"
#include "fathom/shell/near_name.h"
#include "fathom/shell/option_values.h"

#include <getopt.h>
#include <stdlib.h>
#include <string.h>

#define FIRST 256 /* getopt's value of the first row: beyond any letter */

int options_list(const struct command *command, void *into, const struct option_row **rows, void **structs) {
    int count = 0;
    for (const struct option_group *group = command->groups; group->rows; group++)
        for (const struct option_row *row = group->rows; row->name && count < MOST_OPTIONS; row++) {
            rows[count] = row;
            if (structs) structs[count] = (char *)into + group->at;
            count++;
        }
    return count;
}

/* ---- options that aren't there ---- */

const char *options_nearest(const char *name, const char *const *names, int count) {
    const char *best = NULL;
    int fewest = near_name_limit(name);
    for (int i = 0; i < count; i++) {
        const int away = near_name_distance(name, names[i]);
        if (away > fewest || (best && away == fewest)) continue;
        fewest = away;
        best = names[i];
    }
    return best;
}

static bool is_word_of(const char *words, const char *name) {
    const size_t length = strlen(name);
    for (const char *at = words; at && (at = strstr(at, name)); at += length)
        if ((at == words || at[-1] == ' ') && (!at[length] || at[length] == ' ')) return true;
    return false;
}

static int refuse(const struct command *command, const char *word, const struct option_row *const *rows,
                  int count) {
    char name[64];
    snprintf(name, sizeof name, "%.*s", (int)strcspn(word, "="), word);
    if (is_word_of(command->later, name)) return cli_error(CLI_USAGE, "%s: not yet available", name);
    const char *names[MOST_OPTIONS];
    for (int i = 0; i < count; i++) names[i] = rows[i]->name;
    const char *meant = options_nearest(name, names, count);
    if (meant)
        return cli_error(CLI_USAGE, "%s: unknown option %s; did you mean %s? fathom %s --help lists them all",
                         command->name, name, meant, command->name);
    return cli_error(CLI_USAGE, "%s: unknown option %s; fathom %s --help lists them", command->name, name,
                     command->name);
}

/* ---- values ---- */

static bool set(const struct option_row *row, void *into, const char *text) {
    void *at = (char *)into + row->at;
    const char *name = row->name;
    if (text && !*text) {
        cli_error(CLI_USAGE, "%s needs a value", name);
        return false;
    }
    switch (row->type) {
    case OPTION_FLAG: return *(bool *)at = true;
    case OPTION_SWITCH: return parse_switch(name, text, at);
    case OPTION_CHOICE: return parse_choice(name, text, row->argument, at);
    case OPTION_TEXT: *(const char **)at = text; return true;
    case OPTION_WHOLE: return cli_parse_long(name, text, (long)row->low, (long)row->high, at);
    case OPTION_NUMBER: return cli_parse_double(name, text, row->low, row->high, at);
    case OPTION_SIZE: return parse_size(name, text, (int)row->low, (int)row->high, at);
    case OPTION_RANGES: return parse_ranges(name, text, at);
    case OPTION_PARSED: return row->parse(into, name, text);
    }
    return false;
}

static int word_count(const struct command *command) {
    int count = 0;
    while (command->words[count].name) count++;
    return count;
}

static int take_word(const struct command *command, void *into, int taken, const char *text) {
    const struct command_word *word = &command->words[taken];
    const int count = word_count(command);
    if (taken < count && *text) {
        *(const char **)((char *)into + word->at) = text;
        return CLI_DONE;
    }
    if (taken < count)
        return cli_error(CLI_USAGE, "%s: the name of the %s is empty", command->name, word->name);
    if (!count) return cli_error(CLI_USAGE, "%s: takes no %s", command->name, text);
    if (count > 1) return cli_error(CLI_USAGE, "%s: %s is one word too many", command->name, text);
    return cli_error(CLI_USAGE, "%s: more than one %s: %s and %s", command->name, command->words[0].name,
                     *(const char **)((char *)into + command->words[0].at), text);
}

/* ---- reading ---- */

/* getopt_long accepts abbreviated names; a script that relied on them would break with the next new option. */
static bool is_whole(const struct option_row *row, char **argv) {
    const char *word = argv[optind - 1];
    if (row->argument && optarg == word) word = argv[optind - 2];
    const size_t length = strlen(row->name);
    return !strncmp(word, row->name, length) && (!word[length] || word[length] == '=');
}

int options_read(const struct command *command, void *into, int argc, char **argv) {
    const struct option_row *rows[MOST_OPTIONS];
    void *structs[MOST_OPTIONS];
    struct option table[MOST_OPTIONS + 2] = {{"help", no_argument, NULL, 'h'}};
    const int count = options_list(command, into, rows, structs);
    int words = 0;
    for (int i = 0; i < count; i++)
        table[i + 1] = (struct option){rows[i]->name + 2, rows[i]->argument ? required_argument : no_argument,
                                       NULL, FIRST + i};
    optind = 0; /* begin anew after any previous use of getopt */
    opterr = 0;
    /* -: words are returned in order, as 1, and the arguments aren't permuted. */
    for (int kind; (kind = getopt_long(argc, argv, "-:h", table, NULL)) != -1;) {
        const int about = kind == ':' || kind == '?' ? optopt : kind;
        const struct option_row *row = about >= FIRST ? rows[about - FIRST] : NULL;
        if (kind == 1) {
            const int status = take_word(command, into, words++, optarg);
            if (status) return status;
        } else if (kind == 'h') {
            help_print(command);
            return CLI_HELPED;
        } else if (kind == ':') {
            return cli_error(CLI_USAGE, "%s needs a value", row->name);
        } else if (kind == '?' && row) {
            return cli_error(CLI_USAGE, "%s takes no value", row->name);
        } else if (kind == '?' && optopt) {
            return refuse(command, (const char[]){'-', (char)optopt, 0}, rows, 0);
        } else if (kind == '?' || !is_whole(row, argv)) {
            const char *word = argv[optind - 1];
            return refuse(command, kind != '?' && optarg == word ? argv[optind - 2] : word, rows, count);
        } else if (!set(row, structs[about - FIRST], optarg)) {
            return CLI_USAGE;
        }
    }
    for (; optind < argc; optind++) { /* after -- */
        const int status = take_word(command, into, words++, argv[optind]);
        if (status) return status;
    }
    if (words < word_count(command))
        return cli_error(CLI_USAGE, "%s: no %s given; fathom %s --help says how", command->name,
                         command->words[words].name, command->name);
    return CLI_DONE;
}
