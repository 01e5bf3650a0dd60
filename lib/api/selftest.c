#include "api/config.h"
#include "selftest/kernel_checks.h"

int fathom_selftest(const fathom_config *config, fathom_selftest_report on_check, void *user) {
    if (!on_check) return FATHOM_ERROR_ARGUMENT;
    device d;
    fathom_config whole;
    error_text words = {0};
    int failed = 0, stop = 0;
    int e = config_take(config, &whole, &words);
    if (e == FATHOM_OK) e = kernel_checks_open(&d, &whole, SHAPE_OWN);
    if (e != FATHOM_OK) return e;
    for (int i = 0; i < kernel_check_count && !stop; i++) {
        char why[256] = "";
        const fathom_check outcome = kernel_checks[i].run(&d, false, why, sizeof why);
        failed += outcome == FATHOM_CHECK_FAILED;
        stop = on_check(user, kernel_checks[i].name, outcome, why);
    }
    device_close(&d);
    return stop ? FATHOM_ERROR_STOPPED : failed;
}
