/* --set NAME=VALUE: any setting of the library's table. */
#include "fathom/shell/set_option.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/near_name.h"

#include <stdio.h>
#include <string.h>

#define NAME_SIZE 64

/* The setting to suggest; false: none. */
static bool find_nearest(const char *name, char nearest[NAME_SIZE]) {
    fathom_setting setting = FATHOM_STRUCT(fathom_setting);
    int fewest = near_name_limit(name);
    *nearest = 0;
    for (int i = 0; fathom_get_setting(i, &setting) == FATHOM_OK; i++) {
        const int away = near_name_distance(name, setting.name);
        if (away > fewest || (*nearest && away == fewest)) continue;
        fewest = away;
        snprintf(nearest, NAME_SIZE, "%s", setting.name);
    }
    return *nearest;
}

static void describe(const char *name, fathom_setting *setting) {
    for (int i = 0; fathom_get_setting(i, setting) == FATHOM_OK; i++)
        if (strcmp(setting->name, name) == 0) return;
}

static bool refuse(const char *option, const char *name, const char *value, int why) {
    fathom_setting setting = FATHOM_STRUCT(fathom_setting);
    char nearest[NAME_SIZE];
    if (why == FATHOM_ERROR_NAME) {
        const bool near = find_nearest(name, nearest);
        cli_error(CLI_USAGE, "%s: there is no setting '%s'%s%s%s; fathom info --settings lists them", option,
                  name, near ? " (did you mean " : "", nearest, near ? "?)" : "");
        return false;
    }
    describe(name, &setting);
    cli_error(CLI_USAGE, "%s: %s: '%s' is %s %s%s%s", option, name, value,
              why != FATHOM_ERROR_VALUE                ? "outside"
              : setting.type == FATHOM_SETTING_WORD ||
                      setting.type == FATHOM_SETTING_BOOL ? "none of"
              : setting.type == FATHOM_SETTING_INT32 ||
                      setting.type == FATHOM_SETTING_INT64 ? "not a whole number in"
                                                           : "not a number in",
              setting.range_text, *setting.unit ? " " : "", setting.unit);
    return false;
}

bool set_option_apply(const char *option, const char *text, fathom_config *config) {
    char name[NAME_SIZE];
    const char *equals = strchr(text, '=');
    if (!equals || equals == text) {
        cli_error(CLI_USAGE, "%s: '%s' isn't NAME=VALUE", option, text);
        return false;
    }
    snprintf(name, sizeof name, "%.*s", (int)(equals - text), text);
    const int result = fathom_config_set(config, name, equals + 1);
    return result == FATHOM_OK || refuse(option, name, equals + 1, result);
}

bool set_option_names(const char *text, const char *name) {
    const size_t length = strlen(name);
    return strncmp(text, name, length) == 0 && text[length] == '=';
}
