/* The caller's settings: filled in at the caller's size, and copied in whole. */
#include "api/config.h"

#include "api/settings.h"
#include "base/sized.h"

static int fill(fathom_config *config, size_t size, const fathom_config *whole) {
    if (!config || size < sizeof config->struct_size || size > SIZED_MAX) return FATHOM_ERROR_ARGUMENT;
    sized_out(config, size, whole, sizeof *whole);
    return FATHOM_OK;
}

int fathom_config_init_sized(fathom_config *config, size_t size) {
    const fathom_config c = config_default();
    return fill(config, size, &c);
}

int fathom_config_preset_sized(fathom_config *config, size_t size, int32_t preset) {
    const fathom_config c = config_preset(preset);
    const int e = fill(config, size, &c);
    return e == FATHOM_OK && (preset < FATHOM_PRESET_TINY || preset > FATHOM_PRESET_LARGE)
               ? FATHOM_ERROR_ARGUMENT
               : e;
}

int config_take(const fathom_config *config, fathom_config *whole, error_text *r) {
    *whole = config_default();
    r->log = NULL; /* the caller's log may lie beyond the caller's struct */
    if (!config) return error_text_fail(r, FATHOM_ERROR_ARGUMENT, FATHOM_LOG_ERROR, "config is NULL");
    if (sized_of(config) == 0)
        return error_text_fail(r, FATHOM_ERROR_ARGUMENT, FATHOM_LOG_ERROR,
                               "config's struct_size is %u: start from fathom_config_init()",
                               config->struct_size);
    if (!sized_in(whole, sizeof *whole, config))
        return error_text_fail(
            r, FATHOM_ERROR_CONFIG, FATHOM_LOG_ERROR,
            "config has %u bytes, this library's %zu, and the rest isn't zero: a setting of a later version",
            config->struct_size, sizeof *whole);
    r->log = whole->log;
    r->log_user = whole->log_user;
    whole->log = error_text_log;
    whole->log_user = r;
    return FATHOM_OK;
}
