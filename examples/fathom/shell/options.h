/* The arguments of commands, as tables. Parsing (getopt_long), --help, shell completion and the manual page all use
 * them, so that they can't differ. */
#ifndef FATHOM_SHELL_OPTIONS_H
#define FATHOM_SHELL_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>

enum option_type {
    OPTION_FLAG,   /* bool: takes no value, sets true */
    OPTION_SWITCH, /* bool: on|off */
    OPTION_CHOICE, /* int: the index of the value among the row's words, such as "model|previous" */
    OPTION_TEXT,   /* const char *: not empty */
    OPTION_WHOLE,  /* long within low..high */
    OPTION_NUMBER, /* double within low..high */
    OPTION_SIZE,   /* struct option_size: WxH, both within low..high */
    OPTION_RANGES, /* struct frame_ranges: A:B[,A:B], added to the present ones */
    OPTION_PARSED  /* by the row's parse */
};

struct option_row {
    const char *name;     /* with its dashes; NULL ends a table */
    const char *argument; /* the value's name in the help, or its words, separated by |; NULL: takes no value */
    enum option_type type;
    size_t at;        /* offset of the target in the table's struct */
    double low, high; /* limits, for types that have them */
    /* Gets that struct. False after an error message (exit status 2). */
    bool (*parse)(void *into, const char *option, const char *text);
    const char *help; /* wrapped where it is long */
};

/* A table of options under a title; several commands may share one. */
struct option_group {
    const char *title;             /* NULL: continues the previous group */
    const struct option_row *rows; /* NULL ends a command's groups */
    size_t at;                     /* offset of the table's struct in the command's */
};

/* A word that isn't an option, such as FOLDER. All are needed. */
struct command_word {
    const char *name; /* lower case; NULL ends them */
    size_t at;        /* offset of the const char * to set */
};

#define COMMAND_WORDS 2 /* at most */

struct command {
    const char *name;
    const char *summary;                           /* for the list of commands */
    const char *about;                             /* a paragraph for the help */
    const struct command_word words[COMMAND_WORDS + 1];
    const struct option_group *groups;
    const char *later;                             /* options of later versions, separated by blanks */
    const char *output;                            /* description of stdout, for the help; NULL: none */
    int (*run)(const struct command *command, int argc, char **argv); /* argv[0] is the command's name */
};

#define MOST_OPTIONS 96 /* of one command */

/* Reads the arguments into the command's struct, which has the defaults. Returns CLI_DONE; CLI_HELPED after printing
 * the help; CLI_USAGE after an error message. */
int options_read(const struct command *command, void *into, int argc, char **argv);

/* Fills in the command's rows and, unless structs is NULL, the struct of each. Returns their number. */
int options_list(const struct command *command, void *into, const struct option_row **rows, void **structs);

/* The name to suggest in place of one that isn't among them, or NULL. */
const char *options_nearest(const char *name, const char *const *names, int count);

#endif
