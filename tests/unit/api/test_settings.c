/* The table of settings: that it is whole, and that text goes in and comes out of it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/settings.h"
#include "api/settings_table.h"

static fathom_config fresh(void) {
    fathom_config c;
    assert_int_equal(fathom_config_init(&c), FATHOM_OK);
    return c;
}

/* ---- the table ----------------------------------------------------------------------------------------------------- */

/* What has no value that a text could give. */
static const char *const without_row[] = {"struct_size", "block_store",
                                          "inertial_hook", "inertial_user", "log", "log_user", "unused"};

static bool has_row(const char *field) {
    const size_t length = strlen(field);
    for (size_t i = 0; i < sizeof without_row / sizeof *without_row; i++)
        if (strcmp(without_row[i], field) == 0) return true;
    for (int i = 0; i < settings_count; i++) {
        const char *name = settings_table[i].name;
        if (strncmp(name, field, length) == 0 && strchr(".[", name[length])) return true; /* strchr finds the end, too */
    }
    return false;
}

/* The names that a line of a struct declares, each to be found in the table. */
static int check_line(char *line) {
    int fields = 0;
    char *comment = strstr(line, "/*"), *from = line + strspn(line, " ");
    if (comment) *comment = 0;
    if (strncmp(from, "const ", 6) == 0) from += 6;
    if (!strchr(line, ';') || !strchr(from, ' ')) return 0;
    for (char *name = strtok(strchr(from, ' '), " *,;\n"); name; name = strtok(NULL, " *,;\n")) {
        name[strcspn(name, "[")] = 0;
        if (!has_row(name)) print_error("%s has no row\n", name);
        assert_true(has_row(name));
        fields++;
    }
    return fields;
}

static void every_field_of_the_header_has_a_row(void **state) {
    (void)state;
    FILE *header = fopen("lib/fathom.h", "r");
    char line[512];
    int fields = 0;
    bool inside = false, comment = false;
    assert_non_null(header);
    while (fgets(line, sizeof line, header) && !(inside && line[0] == '}')) {
        if (inside && !comment) {
            comment = strstr(line, "/*") && !strstr(line, "*/");
            fields += check_line(line);
        } else if (strstr(line, "*/"))
            comment = false;
        if (strncmp(line, "/* All settings", 15) == 0) inside = true, comment = !strstr(line, "*/");
    }
    fclose(header);
    assert_true(fields > 60);
}

/* No byte of the struct belongs to two rows; what belongs to none is a callback, struct_size or padding. */
static void rows_cover_the_struct_once(void **state) {
    (void)state;
    static unsigned char owner[sizeof(fathom_config)];
    const struct {
        size_t at, size;
    } others[] = {
#define OTHER(field) {offsetof(fathom_config, field), sizeof ((fathom_config *)0)->field}
        OTHER(struct_size), OTHER(block_store), OTHER(inertial_hook),
        OTHER(inertial_user), OTHER(log), OTHER(log_user), OTHER(depth_camera.unused), OTHER(unused)};
    memset(owner, 0, sizeof owner);
    for (int i = 0; i < settings_count; i++)
        for (size_t k = 0; k < settings_table[i].size; k++) assert_int_equal(owner[settings_table[i].at + k]++, 0);
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        for (size_t k = 0; k < others[i].size; k++) assert_int_equal(owner[others[i].at + k]++, 0);
    size_t gap = 0;
    for (size_t k = 0; k < sizeof owner; k++) {
        gap = owner[k] ? 0 : gap + 1;
        if (gap >= 8) print_error("nothing owns the bytes up to %zu\n", k);
        assert_true(gap < 8);
    }
}

static void defaults_lie_within_their_ranges(void **state) {
    (void)state;
    const fathom_config c = fresh();
    for (int i = 0; i < settings_count; i++) {
        const setting_row *row = &settings_table[i];
        if (!setting_allows(row, row->value)) print_error("%s\n", row->name);
        assert_true(setting_allows(row, row->value));
        if (row->type != FATHOM_SETTING_TEXT) assert_true(row->low < row->high);
        assert_true(fabs(setting_value(row, &c) - row->value) <= 1e-6 * fabs(row->value));
    }
    assert_int_equal(config_check(&c), FATHOM_OK);
}

static void names_are_unique_and_end_with_their_unit(void **state) {
    (void)state;
    static const char *const endings[][2] = {
        {"_rad_s_sqrthz", "rad/s/sqrt(Hz)"}, {"_m_s2_sqrthz", "m/s^2/sqrt(Hz)"}, {"_rad_s2", "rad/s^2"}, {"_m_s2", "m/s^2"},
        {"_rad_s", "rad/s"}, {"_per_m", "1/m"}, {"_per_metre", "1/m"}, {"_bytes", "bytes"}, {"_rad", "rad"}, {"_ns", "ns"},
        {"_sigmas", "sigma"}, {"_m", "m"}};
    const size_t count = sizeof endings / sizeof *endings;
    for (int i = 0; i < settings_count; i++) {
        const setting_row *row = &settings_table[i];
        for (int j = 0; j < i; j++) assert_string_not_equal(row->name, settings_table[j].name);
        assert_true(*row->meaning && *row->group && !strchr(row->meaning, '\n'));
        if (strpbrk(row->name, ".[")) continue; /* parts of what has its unit in the header */
        const size_t length = strlen(row->name);
        size_t k = 0;
        while (k < count && (strlen(endings[k][0]) > length ||
                             strcmp(row->name + length - strlen(endings[k][0]), endings[k][0]) != 0))
            k++;
        const char *unit = k < count ? endings[k][1] : strcmp(row->unit, "px") == 0 ? "px" : "";
        if (strcmp(row->unit, unit) != 0) print_error("%s: %s\n", row->name, row->unit);
        assert_string_equal(row->unit, unit);
    }
}

/* ---- text ---------------------------------------------------------------------------------------------------------- */

static void round_trip(const setting_row *row, const char *text) {
    char out[64], again[64];
    fathom_config c = fresh(), d = fresh();
    if (fathom_config_set(&c, row->name, text)) print_error("%s=%s\n", row->name, text);
    assert_int_equal(fathom_config_set(&c, row->name, text), FATHOM_OK);
    assert_true(fathom_config_get(&c, row->name, out, sizeof out) == (int)strlen(out));
    assert_int_equal(fathom_config_set(&d, row->name, out), FATHOM_OK);
    if (row->type != FATHOM_SETTING_TEXT) assert_memory_equal(&c, &d, sizeof c); /* to the bit, and nothing else moved */
    fathom_config_get(&d, row->name, again, sizeof again);
    assert_string_equal(out, again);
}

static void every_setting_goes_in_and_comes_out_as_text(void **state) {
    (void)state;
    for (int i = 0; i < settings_count; i++) {
        const setting_row *row = &settings_table[i];
        fathom_setting s = FATHOM_STRUCT(fathom_setting);
        char text[64];
        assert_int_equal(fathom_get_setting(i, &s), FATHOM_OK);
        assert_string_equal(s.name, row->name);
        round_trip(row, s.default_text);
        if (row->type == FATHOM_SETTING_TEXT) {
            round_trip(row, "some words");
            round_trip(row, "");
            continue;
        }
        if (*row->words) {
            for (const char *word = row->words; word; word = strchr(word, '|') ? strchr(word, '|') + 1 : NULL) {
                snprintf(text, sizeof text, "%.*s", (int)strcspn(word, "|"), word);
                round_trip(row, text);
            }
            continue;
        }
        const bool whole = row->type == FATHOM_SETTING_INT32 || row->type == FATHOM_SETTING_INT64;
        const double values[] = {row->low, row->high, row->low + (row->high - row->low) * 0.3};
        for (int k = 0; k < 3; k++) {
            snprintf(text, sizeof text, whole ? "%.0f" : "%.17g", whole ? floor(values[k]) : values[k]);
            round_trip(row, text);
        }
    }
    fathom_setting s = FATHOM_STRUCT(fathom_setting);
    assert_int_equal(fathom_get_setting(settings_count, &s), FATHOM_ERROR_NO_DATA);
    assert_int_equal(fathom_get_setting(-1, &s), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_get_setting(0, NULL), FATHOM_ERROR_ARGUMENT);
}

static void sixty_four_bits_survive_as_text(void **state) {
    (void)state;
    fathom_config c = fresh();
    char text[32];
    assert_int_equal(fathom_config_set(&c, "imu_clock_offset_ns", "-1234567890123456789"), FATHOM_OK);
    assert_true(c.imu_clock_offset_ns == -1234567890123456789);
    fathom_config_get(&c, "imu_clock_offset_ns", text, sizeof text);
    assert_string_equal(text, "-1234567890123456789");
    assert_int_equal(fathom_config_set(&c, "first_pose.position[0]", "0.12345678901234567"), FATHOM_OK);
    assert_true(c.first_pose.position[0] == 0.12345678901234567);
    fathom_config_get(&c, "first_pose.position[0]", text, sizeof text);
    assert_true(strtod(text, NULL) == 0.12345678901234567);
}

static void assert_refused(const char *name, const char *value, int why) {
    fathom_config c = fresh();
    const fathom_config before = c;
    if (fathom_config_set(&c, name, value) != why) print_error("%s=%s\n", name, value);
    assert_int_equal(fathom_config_set(&c, name, value), why);
    assert_memory_equal(&c, &before, sizeof c);
}

static void wrong_names_values_and_ranges_are_told_apart(void **state) {
    (void)state;
    assert_refused("voxel", "0.02", FATHOM_ERROR_NAME);
    assert_refused("", "1", FATHOM_ERROR_NAME);
    assert_refused("struct_size", "1", FATHOM_ERROR_NAME);
    assert_refused("log", "1", FATHOM_ERROR_NAME);
    assert_refused("max_iterations", "1", FATHOM_ERROR_NAME);
    assert_refused("max_iterations[3]", "1", FATHOM_ERROR_NAME);
    static const char *const no_numbers[] = {"", " 0.02", "0.02 ", "0,02", "0.02m", "nan", "inf", "-inf", "0x1p-5", "1e",
                                             ".", "-", "--1", "1.2.3", "0.02f", "on"};
    for (size_t i = 0; i < sizeof no_numbers / sizeof *no_numbers; i++)
        assert_refused("voxel_m", no_numbers[i], FATHOM_ERROR_VALUE);
    static const char *const no_whole[] = {"", "1.0", "1e1", "0x10", " 1", "1 ", "one", "+", "99999999999999999999999x"};
    for (size_t i = 0; i < sizeof no_whole / sizeof *no_whole; i++) {
        assert_refused("max_iterations[0]", no_whole[i], FATHOM_ERROR_VALUE);
        assert_refused("max_memory_bytes", no_whole[i], FATHOM_ERROR_VALUE);
    }
    assert_refused("against", "0", FATHOM_ERROR_VALUE);
    assert_refused("against", "mode", FATHOM_ERROR_VALUE);
    assert_refused("against", "model|previous", FATHOM_ERROR_VALUE);
    assert_refused("imu", "yes", FATHOM_ERROR_VALUE);
    assert_refused("voxel_m", "0.0009", FATHOM_ERROR_CONFIG);
    assert_refused("voxel_m", "1.001", FATHOM_ERROR_CONFIG);
    assert_refused("voxel_m", "1e999", FATHOM_ERROR_CONFIG);
    assert_refused("max_iterations[0]", "101", FATHOM_ERROR_CONFIG);
    assert_refused("max_iterations[0]", "4294967296", FATHOM_ERROR_CONFIG);
    assert_refused("max_blocks", "63", FATHOM_ERROR_CONFIG);
    assert_refused("max_memory_bytes", "99999999999999999999999", FATHOM_ERROR_CONFIG);
    fathom_config c = fresh();
    char text[8];
    assert_int_equal(fathom_config_set(NULL, "voxel_m", "1"), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_config_set(&c, NULL, "1"), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_config_set(&c, "voxel_m", NULL), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_config_get(&c, "voxel", text, sizeof text), FATHOM_ERROR_NAME);
    assert_int_equal(fathom_config_get(&c, "voxel_m", NULL, 8), FATHOM_ERROR_ARGUMENT);
}

static void a_bool_may_be_said_in_two_ways(void **state) {
    (void)state;
    fathom_config c = fresh();
    static const char *const words[] = {"off", "on", "false", "true"};
    for (int i = 0; i < 4; i++) {
        c.refine_rig = i % 2 == 0;
        assert_int_equal(fathom_config_set(&c, "refine_rig", words[i]), FATHOM_OK);
        assert_int_equal(c.refine_rig, i % 2);
    }
}

static void text_that_does_not_fit_is_cut_and_counted(void **state) {
    (void)state;
    fathom_config c = fresh();
    char text[5] = "xxxx";
    assert_int_equal(fathom_config_set(&c, "device", "some device"), FATHOM_OK);
    assert_int_equal(fathom_config_get(&c, "device", text, sizeof text), 11);
    assert_string_equal(text, "some");
    assert_int_equal(fathom_config_get(&c, "device", NULL, 0), 11);
    assert_int_equal(fathom_config_set(&c, "device", "default"), FATHOM_OK);
    assert_null(c.device);
}

/* What lies beyond the caller's struct is neither read nor written. */
static void an_older_struct_has_only_its_own_settings(void **state) {
    (void)state;
    const size_t size = offsetof(fathom_config, voxel_m) + sizeof(float);
    fathom_config *c = malloc(size);
    char text[16];
    assert_non_null(c);
    assert_int_equal(fathom_config_init_sized(c, size), FATHOM_OK);
    assert_int_equal(fathom_config_set(c, "voxel_m", "0.02"), FATHOM_OK);
    assert_int_equal(fathom_config_set(c, "truncation_m", "0.1"), FATHOM_ERROR_NAME);
    assert_int_equal(fathom_config_get(c, "truncation_m", text, sizeof text), FATHOM_ERROR_NAME);
    fathom_config_get(c, "voxel_m", text, sizeof text);
    assert_string_equal(text, "0.02");
    free(c);
}

/* A locale that writes 0,5, made for the test: few machines have one. */
static bool take_comma_locale(char folder[], size_t size) {
    char command[256], path[128];
    snprintf(folder, size, "/tmp/fathom-locale-XXXXXX");
    if (!mkdtemp(folder)) return false;
    snprintf(path, sizeof path, "%s/source", folder);
    FILE *source = fopen(path, "w");
    if (!source) return false;
    fputs("LC_NUMERIC\ndecimal_point \",\"\nthousands_sep \"\"\ngrouping -1\nEND LC_NUMERIC\n", source);
    fclose(source);
    snprintf(command, sizeof command, "localedef --no-archive --force -c -i %s %s/comma >/dev/null 2>&1", path, folder);
    if (system(command) == -1) return false;
    setenv("LOCPATH", folder, 1);
    return setlocale(LC_NUMERIC, "comma") != NULL;
}

static void a_locale_with_a_comma_changes_nothing(void **state) {
    (void)state;
    char folder[64], command[96], text[16] = "";
    const bool found = take_comma_locale(folder, sizeof folder);
    snprintf(command, sizeof command, "rm -rf %s", folder);
    assert_int_equal(system(command), 0);
    if (!found) skip();
    fathom_config c = fresh();
    snprintf(text, sizeof text, "%.1f", 0.5);
    assert_string_equal(text, "0,5"); /* it is one */
    const int set = fathom_config_set(&c, "voxel_m", "0.025"), comma = fathom_config_set(&c, "voxel_m", "0,03");
    fathom_config_get(&c, "voxel_m", text, sizeof text);
    setlocale(LC_NUMERIC, "C");
    assert_int_equal(set, FATHOM_OK);
    assert_int_equal(comma, FATHOM_ERROR_VALUE);
    assert_true(c.voxel_m == 0.025f);
    assert_string_equal(text, "0.025");
}

/* ---- check and presets ---------------------------------------------------------------------------------------------- */

static void keep(void *user, fathom_log_level level, const char *text) {
    (void)level;
    snprintf(user, 512, "%s", text);
}

static void a_refusal_names_setting_value_range_and_unit(void **state) {
    (void)state;
    char said[512] = "";
    fathom_config c = fresh();
    c.log = keep;
    c.log_user = said;
    c.voxel_m = 3.5f;
    assert_int_equal(config_check(&c), FATHOM_ERROR_CONFIG);
    assert_string_equal(said, "setting voxel_m is 3.5 m; its range is 0.001..1 m");
    c = fresh();
    c.log = keep;
    c.log_user = said;
    c.against = 7;
    assert_int_equal(config_check(&c), FATHOM_ERROR_CONFIG);
    assert_string_equal(said, "setting against is 7; its range is model|previous");
    c = fresh();
    c.log = keep;
    c.log_user = said;
    c.max_depth_m = 0.2f;
    assert_int_equal(config_check(&c), FATHOM_ERROR_CONFIG);
    assert_non_null(strstr(said, "max_depth_m"));
}

static void every_number_out_of_range_is_refused_by_name(void **state) {
    (void)state;
    char said[512];
    for (int i = 0; i < settings_count; i++) {
        const setting_row *row = &settings_table[i];
        if (row->type == FATHOM_SETTING_TEXT || row->type == FATHOM_SETTING_BOOL) continue;
        const bool real = row->type == FATHOM_SETTING_FLOAT || row->type == FATHOM_SETTING_DOUBLE;
        const double step = real ? 1e-3 : 1 + 1e-6 * fabs(row->high);
        const double values[] = {row->low - fmax(fabs(row->low) * 1e-3, step), row->high + fmax(fabs(row->high) * 1e-3, step),
                                 NAN};
        for (int k = 0; k < (real ? 3 : 2); k++) {
            fathom_config c = fresh();
            *said = 0;
            c.log = keep;
            c.log_user = said;
            setting_store(row, &c, values[k]);
            if (config_check(&c) != FATHOM_ERROR_CONFIG || !strstr(said, row->name)) print_error("%s: %s\n", row->name, said);
            assert_int_equal(config_check(&c), FATHOM_ERROR_CONFIG);
            assert_non_null(strstr(said, row->name));
        }
    }
}

static void presets_differ_in_three_settings_alone(void **state) {
    (void)state;
    const fathom_config c = fresh();
    static const int32_t presets[] = {FATHOM_PRESET_TINY, FATHOM_PRESET_SMALL, FATHOM_PRESET_LARGE};
    for (int p = 0; p < 3; p++) {
        const fathom_config other = config_preset(presets[p]);
        int different = 0;
        for (int i = 0; i < settings_count; i++)
            different += setting_value(&settings_table[i], &c) != setting_value(&settings_table[i], &other);
        assert_int_equal(different, presets[p] == FATHOM_PRESET_SMALL ? 0 : 3);
        assert_int_equal(config_check(&other), FATHOM_OK);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_field_of_the_header_has_a_row),
        cmocka_unit_test(rows_cover_the_struct_once),
        cmocka_unit_test(defaults_lie_within_their_ranges),
        cmocka_unit_test(names_are_unique_and_end_with_their_unit),
        cmocka_unit_test(every_setting_goes_in_and_comes_out_as_text),
        cmocka_unit_test(sixty_four_bits_survive_as_text),
        cmocka_unit_test(wrong_names_values_and_ranges_are_told_apart),
        cmocka_unit_test(a_bool_may_be_said_in_two_ways),
        cmocka_unit_test(text_that_does_not_fit_is_cut_and_counted),
        cmocka_unit_test(an_older_struct_has_only_its_own_settings),
        cmocka_unit_test(a_locale_with_a_comma_changes_nothing),
        cmocka_unit_test(a_refusal_names_setting_value_range_and_unit),
        cmocka_unit_test(every_number_out_of_range_is_refused_by_name),
        cmocka_unit_test(presets_differ_in_three_settings_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
