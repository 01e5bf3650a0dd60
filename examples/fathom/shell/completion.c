/* Completion for bash. A value's name in the help determines what is offered for it: files for FILE, folders for
 * FOLDER, or words separated by |. */
#include "fathom/shell/help.h"

#include <ctype.h>
#include <string.h>

/* The literal words of an argument: "file|none" offers none. */
static void print_words(const char *argument) {
    const char *before = "";
    for (const char *word = argument; word;) {
        const size_t length = strcspn(word, "|");
        if (islower((unsigned char)*word)) {
            printf("%s%.*s", before, (int)length, word);
            before = " ";
        }
        word = word[length] ? word + length + 1 : NULL;
    }
}

/* One alternative of the case over the previous word: all options whose value has this name. */
static void print_values(const struct option_row *const *rows, int count, const char *argument) {
    const char *before = "        ";
    for (int i = 0; i < count; i++)
        if (rows[i]->argument && !strcmp(rows[i]->argument, argument)) {
            printf("%s%s", before, rows[i]->name);
            before = "|";
        }
    printf(") words='");
    print_words(argument);
    printf("' kind=%s ;;\n", strstr(argument, "FILE")                                      ? "file"
                             : strstr(argument, "FOLDER") || strstr(argument, "ADDRESS") ? "folder"
                                                                                         : "word");
}

static bool came_before(const struct option_row *const *rows, int row) {
    for (int i = 0; i < row; i++)
        if (rows[i]->argument && !strcmp(rows[i]->argument, rows[row]->argument)) return true;
    return false;
}

static void print_command(const struct command *command) {
    const struct option_row *rows[MOST_OPTIONS];
    const int count = options_list(command, NULL, rows, NULL);
    bool file = false;
    for (const struct command_word *word = command->words; word->name; word++)
        file |= !strcmp(word->name, "file");
    printf("    %s)\n        words='--help", command->name);
    for (int i = 0; i < count; i++) printf(" %s", rows[i]->name);
    printf("' kind=%s\n        case $before in\n",
           file ? "file" : command->words[0].name ? "folder" : "word");
    for (int i = 0; i < count; i++)
        if (rows[i]->argument && !came_before(rows, i)) print_values(rows, count, rows[i]->argument);
    puts("        esac ;;");
}

void completion_print_bash(const struct command *const *commands) {
    puts("# Completion for bash, made by fathom --completion bash.\n"
         "_fathom() {\n"
         "    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} words kind\n"
         "    if [ \"$word\" = = ]; then # bash takes --name=value for three words\n"
         "        word=\n"
         "    elif [ \"$before\" = = ] && [ \"$COMP_CWORD\" -gt 2 ]; then\n"
         "        before=${COMP_WORDS[COMP_CWORD-2]}\n"
         "    fi\n"
         "    case ${COMP_WORDS[1]} in");
    for (const struct command *const *c = commands; *c; c++) print_command(*c);
    puts("    esac\n"
         "    if [ \"$COMP_CWORD\" -eq 1 ]; then\n"
         "        kind=word");
    fputs("        words='--help --version --completion --man", stdout);
    for (const struct command *const *c = commands; *c; c++) printf(" %s", (*c)->name);
    puts("'\n"
         "    fi\n"
         "    COMPREPLY=()\n"
         "    [ -z \"$words\" ] || COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))\n"
         "    case $word in -*) return ;; esac\n"
         "    compopt -o filenames 2>/dev/null\n"
         "    [ \"$kind\" != file ] || COMPREPLY+=($(compgen -f -- \"$word\"))\n"
         "    [ \"$kind\" != folder ] || COMPREPLY+=($(compgen -d -- \"$word\"))\n"
         "}\n"
         "complete -F _fathom fathom");
}
