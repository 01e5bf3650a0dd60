/* The table of settings: every number, word and text of fathom_config is a row. Defaults, checks, the public
 * enumeration, fathom_config_set, the command's help and docs/SETTINGS.md come from it. */
#ifndef FATHOM_API_SETTINGS_TABLE_H
#define FATHOM_API_SETTINGS_TABLE_H

#include "fathom.h"

typedef struct {
    const char *group, *name, *unit;
    int32_t type;      /* fathom_setting_type */
    size_t at, size;   /* offset and size in fathom_config */
    double low, high;  /* 0, 0 for text */
    bool zero;         /* 0 is allowed, too */
    double value;      /* default; NULL for text */
    const char *words; /* of FATHOM_SETTING_WORD, "model|previous", by value */
    const char *meaning;
} setting_row;

extern const setting_row settings_table[];
extern const int settings_count;

/* NULL: no setting has that name. */
const setting_row *settings_find(const char *name);

/* A number's value in the struct; texts have none. */
double setting_value(const setting_row *row, const fathom_config *config);
void setting_store(const setting_row *row, fathom_config *config, double value);

/* Its value and its range as text, as snprintf counts: "0.01", "model"; "0.001..1", "model|previous". */
int setting_print(const setting_row *row, const fathom_config *config, char *text, size_t size);
int setting_print_range(const setting_row *row, char *text, size_t size);

/* Whether the row allows the value; not for NaN. */
bool setting_allows(const setting_row *row, double value);

#endif
