/* The manual page, in roff with man's macros. */
#include "fathom/shell/help.h"

#include <ctype.h>
#include <string.h>

#include "fathom.h"

/* Characters to escape for roff: a backslash, a dash that is to stay one, a dot or quote at the beginning of a line. */
static void put_text(const char *text) {
    bool begun = true; /* of a line */
    for (; *text; text++) {
        if (begun && (*text == '.' || *text == '\'')) fputs("\\&", stdout);
        if (*text == '\n')
            fputs("\n.br\n", stdout);
        else if (*text == '\\')
            fputs("\\e", stdout);
        else if (*text == '-')
            fputs("\\-", stdout);
        else
            putchar(*text);
        begun = *text == '\n';
    }
}

static void put_row(const struct option_row *row) {
    fputs(".TP\n\\fB", stdout);
    put_text(row->name);
    fputs("\\fR", stdout);
    if (row->argument) {
        fputs(" \\fI", stdout);
        put_text(row->argument);
        fputs("\\fR", stdout);
    }
    putchar('\n');
    put_text(row->help);
    putchar('\n');
}

/* The first command before this one with the same table, or NULL. */
static const struct command *first_with(const struct option_group *group,
                                        const struct command *const *commands,
                                        const struct command *present) {
    for (; *commands != present; commands++)
        for (const struct option_group *g = (*commands)->groups; g->rows; g++)
            if (g->rows == group->rows) return *commands;
    return NULL;
}

static void put_options(const struct command *command, const struct command *const *commands) {
    const struct command *like = NULL;
    for (const struct option_group *group = command->groups; group->rows; group++) {
        const struct command *first = first_with(group, commands, command);
        if (first) {
            like = first;
            continue;
        }
        for (const struct option_row *row = group->rows; row->name; row++) put_row(row);
    }
    if (!like) return;
    printf(".PP\nAnd these options of \\fBfathom %s\\fR:", like->name);
    for (const struct option_group *group = command->groups; group->rows; group++)
        for (const struct option_row *row = group->rows; row->name && first_with(group, commands, command);
             row++) {
            fputs("\n\\fB", stdout);
            put_text(row->name);
            fputs("\\fR", stdout);
        }
    putchar('\n');
}

static void put_command(const struct command *command, const struct command *const *commands) {
    printf(".SS \"");
    help_print_usage(command, stdout);
    puts("\"");
    put_text(command->about);
    putchar('\n');
    put_options(command, commands);
    if (!command->output) return;
    puts(".PP");
    put_text(command->output);
    putchar('\n');
}

void manual_print(const struct command *const *commands) {
    printf(".TH FATHOM 1 \"\" \"fathom %s\" \"User Commands\"\n", fathom_version());
    puts(".SH NAME\nfathom \\- track and reconstruct with a depth camera and an inertial sensor\n"
         ".SH SYNOPSIS\n.B fathom\n.I COMMAND\n[\\fIoptions\\fR]\n.br\n"
         ".B fathom \\-\\-help\n|\n.B \\-\\-version\n|\n.B \\-\\-completion bash\n|\n.B \\-\\-man\n"
         ".SH COMMANDS");
    for (const struct command *const *c = commands; *c; c++) put_command(*c, commands);
    puts(".SH EXIT STATUS\n"
         ".TP\n0\ndone\n.TP\n1\nit failed; one line on standard error says what and where\n"
         ".TP\n2\nwrong usage or settings\n.TP\n130\nstopped by Ctrl\\-C, files whole");
}
