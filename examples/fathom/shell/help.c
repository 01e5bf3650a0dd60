#include "fathom/shell/help.h"

#include <ctype.h>
#include <string.h>

#define WIDTH 100
#define INDENT 4
#define COLUMN 31 /* column of an option's description */

/* Writes the text from the current column on, in lines that begin at `indent`. */
static void print_wrapped(const char *text, int column, int indent) {
    bool begun = true; /* at the beginning of a line: no blank before the next word */
    while (*text) {
        const int length = (int)strcspn(text, " \n");
        if (!begun && column + 1 + length > WIDTH) {
            printf("\n%*s", indent, "");
            column = indent;
            begun = true;
        }
        column += printf("%s%.*s", begun ? "" : " ", length, text);
        begun = false;
        text += length;
        if (*text == '\n') {
            printf("\n%*s", text[1] == '\n' ? 0 : indent, "");
            column = indent;
            begun = true;
        }
        if (*text) text++;
    }
    putchar('\n');
}

const char *help_option(const struct option_row *row, char *text, size_t room) {
    snprintf(text, room, "%s%s%s", row->name, row->argument ? " " : "", row->argument ? row->argument : "");
    return text;
}

void help_print_usage(const struct command *command, FILE *out) {
    fprintf(out, "fathom %s", command->name);
    for (const struct command_word *word = command->words; word->name; word++) {
        fputc(' ', out);
        for (const char *c = word->name; *c; c++) fputc(toupper((unsigned char)*c), out);
    }
    fputs(" [options]", out);
}

static void print_row(const struct option_row *row) {
    char text[128];
    int column = printf("%*s%s", INDENT, "", help_option(row, text, sizeof text));
    if (column + 1 > COLUMN) {
        putchar('\n');
        column = 0;
    }
    printf("%*s", COLUMN - column, "");
    print_wrapped(row->help, COLUMN, COLUMN);
}

void help_print(const struct command *command) {
    fputs("usage: ", stdout);
    help_print_usage(command, stdout);
    fputs("\n\n", stdout);
    print_wrapped(command->about, 0, 0);
    for (const struct option_group *group = command->groups; group->rows; group++) {
        if (group->title) printf("\n%s\n", group->title);
        for (const struct option_row *row = group->rows; row->name; row++) print_row(row);
    }
    putchar('\n');
    if (command->output) print_wrapped(command->output, 0, 0);
    puts("Exit status: 0 done, 1 failed, 2 wrong usage or settings, 130 stopped by Ctrl-C, files whole.");
}

void help_print_commands(const struct command *const *commands) {
    puts("usage: fathom COMMAND [options]\n");
    for (; *commands; commands++) printf("    %-10s %s\n", (*commands)->name, (*commands)->summary);
    puts("\n    fathom COMMAND --help     the command's options\n"
         "    fathom --version          the version\n"
         "    fathom --completion bash  completion of commands and options: source <(fathom "
         "--completion bash)\n"
         "    fathom --man              the manual page: fathom --man | man -l -");
}
