/* The table of settings, for fathom info --settings and docs/SETTINGS.md. */
#include "fathom/settings_page.h"

#include <stdio.h>
#include <string.h>

#include "fathom.h"

static int widest(int width, const char *text) {
    const int length = (int)strlen(text);
    return length > width ? length : width;
}

static const char *or_dash(const char *text) {
    return *text ? text : "-";
}

void settings_page_text(void) {
    fathom_setting s = FATHOM_STRUCT(fathom_setting);
    int name = 4, unit = 4, range = 5, value = 7;
    for (int i = 0; fathom_get_setting(i, &s) == FATHOM_OK; i++) {
        name = widest(name, s.name);
        unit = widest(unit, s.unit);
        range = widest(range, s.range_text);
        value = widest(value, s.default_text);
    }
    printf("%-*s  %-*s  %-*s  %-*s  %s\n", name, "name", unit, "unit", range, "range", value, "default",
           "meaning");
    for (int i = 0; fathom_get_setting(i, &s) == FATHOM_OK; i++)
        printf("%-*s  %-*s  %-*s  %-*s  %s\n", name, s.name, unit, or_dash(s.unit), range, s.range_text,
               value, s.default_text, s.meaning);
}

/* A bar would end the cell. */
static void print_cell(const char *text) {
    for (; *text; text++) printf(*text == '|' ? " or " : "%c", *text);
}

void settings_page_markdown(void) {
    fathom_setting s = FATHOM_STRUCT(fathom_setting);
    const char *group = "";
    printf("# Settings\n\n"
           "Every setting of `fathom_config`, written by `fathom info --settings --markdown` from the "
           "library's table. A program sets\n"
           "the field, or calls `fathom_config_set(&config, \"voxel_m\", \"0.02\")`; the commands take "
           "`--set voxel_m=0.02`. Names carry their\n"
           "unit; `min_` and `max_` are limits. A text's `default` is NULL.\n");
    for (int i = 0; fathom_get_setting(i, &s) == FATHOM_OK; i++) {
        if (strcmp(group, s.group) != 0)
            printf("\n## %s\n\n| name | unit | range | default | meaning |\n|---|---|---|---|---|\n",
                   s.group);
        group = s.group;
        printf("| `%s` | %s | ", s.name, s.unit);
        print_cell(s.range_text);
        printf(" | %s | ", s.default_text);
        print_cell(s.meaning);
        printf(" |\n");
    }
}
