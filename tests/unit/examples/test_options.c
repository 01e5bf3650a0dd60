/* The tables of options (examples/fathom/shell/options.h), on one made up for the purpose. What the real commands take is
 * checked by tests/e2e/options.sh. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fathom/shell/cli.h"
#include "fathom/shell/help.h"
#include "fathom/shell/option_values.h"

struct inner {
    bool on;
    double number;
};

struct all {
    const char *scene, *folder;
    bool flag;
    int choice;
    const char *text;
    long whole;
    struct option_size size;
    struct frame_ranges ranges;
    double parsed;
    struct inner inner;
};

static bool parse_half(void *into, const char *option, const char *text) {
    double number;
    if (!cli_parse_double(option, text, 0, 100, &number)) return false;
    ((struct all *)into)->parsed = number / 2;
    return true;
}

#define AT(field) offsetof(struct all, field)

static const struct option_row outer[] = {
    {"--flag", NULL, OPTION_FLAG, AT(flag), .help = "sets it"},
    {"--choice", "red|green|blue", OPTION_CHOICE, AT(choice), .help = "one of three"},
    {"--text", "FILE", OPTION_TEXT, AT(text), .help = "a file; 'quoted' \\ and -dashed"},
    {"--text-size", "WxH", OPTION_SIZE, AT(size), 8, 4096, .help = "a size"},
    {"--whole", "N", OPTION_WHOLE, AT(whole), 1, 10, .help = "a number"},
    {"--ranges", "A:B[,A:B]", OPTION_RANGES, AT(ranges), .help = ".begins with what roff would take for a request"},
    {"--half", "X", OPTION_PARSED, .parse = parse_half, .help = "halves"},
    {0}};
static const struct option_row within[] = {
    {"--switch", "on|off", OPTION_SWITCH, offsetof(struct inner, on), .help = "on or off"},
    {"--number", "X", OPTION_NUMBER, offsetof(struct inner, number), -1, 1,
     .help = "a help that is so long that it takes more than a line of a terminal that is a hundred columns wide, and so "
             "has to be wrapped"},
    {0}};
static const struct option_group groups[] = {{"Outer", outer, 0}, {"Inner", within, AT(inner)}, {0}};
static const struct command made_up = {.name = "made-up",
                                       .summary = "nothing",
                                       .about = "Is made up.",
                                       .words = {{"scene", AT(scene)}, {"folder", AT(folder)}},
                                       .groups = groups,
                                       .later = "--later --much-later"};

static char said[8192]; /* by the last call, on the stream that was taken */

static FILE *take(int stream, int *kept) {
    FILE *file = tmpfile();
    assert_non_null(file);
    fflush(NULL);
    *kept = dup(stream);
    dup2(fileno(file), stream);
    return file;
}

static void give_back(int stream, int kept, FILE *file) {
    fflush(NULL);
    dup2(kept, stream);
    close(kept);
    rewind(file);
    said[fread(said, 1, sizeof said - 1, file)] = 0;
    fclose(file);
}

#define MOST 16

/* Reads "made-up" and the words of the line; what was said on stderr is in said. */
static int reads(struct all *all, const char *line) {
    static char words[512];
    char *argv[MOST + 1] = {(char[]){"made-up"}};
    int argc = 1, kept;
    snprintf(words, sizeof words, "%s", line);
    for (char *rest = words, *word; (word = strsep(&rest, " ")) && argc < MOST;) argv[argc++] = word;
    *all = (struct all){.whole = 5};
    FILE *file = take(STDERR_FILENO, &kept);
    const int status = options_read(&made_up, all, argc, argv);
    give_back(STDERR_FILENO, kept, file);
    return status;
}

static void refuses(const char *line, const char *words) {
    struct all all;
    assert_int_equal(reads(&all, line), CLI_USAGE);
    if (!strstr(said, words)) fail_msg("'%s': said '%s', not '%s'", line, said, words);
    assert_ptr_equal(strchr(said, '\n'), said + strlen(said) - 1);
}

static void every_type_sets_its_field(void **state) {
    (void)state;
    struct all all;
    assert_int_equal(reads(&all, "room out --flag --choice blue --text=a --text-size 8x4096 --whole 10 --ranges 1:2,4:6 "
                                 "--half=3 --switch=on"),
                     CLI_DONE);
    assert_string_equal(said, "");
    assert_string_equal(all.scene, "room");
    assert_string_equal(all.folder, "out");
    assert_true(all.flag && all.inner.on);
    assert_int_equal(all.choice, 2);
    assert_string_equal(all.text, "a");
    assert_int_equal(all.size.width, 8);
    assert_int_equal(all.size.height, 4096);
    assert_int_equal(all.whole, 10);
    assert_int_equal(all.ranges.count, 2);
    assert_int_equal(all.ranges.range[1].to, 6);
    assert_true(all.parsed == 1.5);
    assert_int_equal(reads(&all, "a b --number -0.5 --switch off"), CLI_DONE);
    assert_true(all.inner.number == -0.5 && !all.inner.on);
    assert_int_equal(all.whole, 5); /* the default stays */
}

static void the_last_value_counts_and_ranges_add_up(void **state) {
    (void)state;
    struct all all;
    assert_int_equal(reads(&all, "a --whole 2 --ranges 1:2 --whole 3 b --ranges 5:6"), CLI_DONE);
    assert_int_equal(all.whole, 3);
    assert_int_equal(all.ranges.count, 2);
}

static void bounds_are_part_of_the_range(void **state) {
    (void)state;
    struct all all;
    assert_int_equal(reads(&all, "a b --whole 1 --number 1"), CLI_DONE);
    refuses("a b --whole 0", "--whole: 0 is outside 1..10");
    refuses("a b --whole 11", "--whole: 11 is outside");
    refuses("a b --number 1.001", "--number: 1.001 is outside");
    refuses("a b --text-size 7x8", "--text-size: 7 is outside");
    refuses("a b --half nan", "--half: 'nan' is not a number");
}

static void values_are_whole_words(void **state) {
    (void)state;
    refuses("a b --choice gree", "--choice: 'gree' is none of red|green|blue");
    refuses("a b --choice red|green", "is none of");
    refuses("a b --whole 3x", "--whole: '3x' is not a whole number");
    refuses("a b --text=", "--text needs a value");
    refuses("a b --text", "--text needs a value");
    refuses("a b --flag=1", "--flag takes no value");
}

static void the_beginning_of_a_name_is_not_the_name(void **state) {
    (void)state;
    refuses("a b --fla", "unknown option --fla; did you mean --flag?");
    refuses("a b --whol 3", "unknown option --whol; did you mean --whole?");
    refuses("a b --whol=3", "unknown option --whol; did you mean --whole?");
    refuses("a b --tex t", "unknown option --tex;"); /* of two */
    struct all all;
    assert_int_equal(reads(&all, "a b --text t"), CLI_DONE); /* though another begins so */
}

static void the_nearest_option_is_suggested_or_none(void **state) {
    (void)state;
    refuses("a b --whoel", "did you mean --whole?");
    refuses("a b --flga", "did you mean --flag?"); /* one swap, where two letters changed would be too far */
    refuses("a b --xyag", "unknown option --xyag; fathom");
    refuses("a b --chioce", "did you mean --choice?");
    refuses("a b --textsize=8x8", "did you mean --text-size?");
    refuses("a b --quantity", "unknown option --quantity; fathom made-up --help lists them");
    refuses("a b -q", "unknown option -q;");
    refuses("a b --a-name-that-is-longer-than-any-option-could-ever-reasonably-be-and-then-some", "unknown option --a-name");
}

static void later_options_say_so(void **state) {
    (void)state;
    refuses("a b --later", "--later: not yet available");
    refuses("a b --much-later=3", "--much-later: not yet available");
    refuses("a b --lat", "unknown option --lat;");
}

static void words_are_counted(void **state) {
    (void)state;
    struct all all;
    refuses("", "the name of the scene is empty");
    refuses("--flag", "no scene given");
    refuses("room", "no folder given; fathom made-up --help says how");
    refuses("a b c", "c is one word too many");
    assert_int_equal(reads(&all, "- -- --flag"), CLI_DONE); /* - is a word, and so is what follows -- */
    assert_string_equal(all.scene, "-");
    assert_string_equal(all.folder, "--flag");
    assert_false(all.flag);
}

/* getopt would sort them, or stop at the first word, as the environment says. */
static void arguments_stay_in_their_order(void **state) {
    (void)state;
    struct all all;
    char *argv[] = {"made-up", "a", "--flag", "b", "--whole", "3", NULL}, *before[7];
    memcpy(before, argv, sizeof argv);
    for (int posix = 0; posix < 2; posix++) {
        if (posix) setenv("POSIXLY_CORRECT", "1", 1);
        all = (struct all){0};
        assert_int_equal(options_read(&made_up, &all, 6, argv), CLI_DONE);
        assert_memory_equal(argv, before, sizeof argv);
        assert_true(all.flag && all.whole == 3);
    }
    unsetenv("POSIXLY_CORRECT");
}

static void help_ends_the_reading(void **state) {
    (void)state;
    struct all all;
    int kept;
    FILE *file = take(STDOUT_FILENO, &kept);
    char out[sizeof said];
    const int status = reads(&all, "--flag --help --no-such-option");
    give_back(STDOUT_FILENO, kept, file);
    memcpy(out, said, sizeof out);
    assert_int_equal(status, CLI_HELPED);
    assert_memory_equal(out, "usage: fathom made-up SCENE FOLDER [options]\n", 45);
    assert_non_null(strstr(out, "\nOuter\n    --flag                     sets it\n"));
    for (const char *line = out; *line; line += strcspn(line, "\n") + 1) assert_true(strcspn(line, "\n") <= 100);
}

static void the_manual_page_keeps_what_roff_would_take_for_its_own(void **state) {
    (void)state;
    const struct command *const commands[] = {&made_up, NULL};
    int kept;
    FILE *file = take(STDOUT_FILENO, &kept);
    manual_print(commands);
    give_back(STDOUT_FILENO, kept, file);
    assert_non_null(strstr(said, "a file; 'quoted' \\e and \\-dashed\n"));
    assert_non_null(strstr(said, "\n\\&.begins with"));
    assert_non_null(strstr(said, "\n\\fB\\-\\-text\\-size\\fR \\fIWxH\\fR\n"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_type_sets_its_field),
        cmocka_unit_test(the_last_value_counts_and_ranges_add_up),
        cmocka_unit_test(bounds_are_part_of_the_range),
        cmocka_unit_test(values_are_whole_words),
        cmocka_unit_test(the_beginning_of_a_name_is_not_the_name),
        cmocka_unit_test(the_nearest_option_is_suggested_or_none),
        cmocka_unit_test(later_options_say_so),
        cmocka_unit_test(words_are_counted),
        cmocka_unit_test(arguments_stay_in_their_order),
        cmocka_unit_test(help_ends_the_reading),
        cmocka_unit_test(the_manual_page_keeps_what_roff_would_take_for_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
