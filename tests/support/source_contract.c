#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include "source_contract.h"

static int errors;

static void count_errors(void *user, fathom_log_level level, const char *text) {
    (void)user, (void)text;
    errors += level == FATHOM_LOG_ERROR;
}

static fathom_source_state state_of(fathom_source *source) {
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(fathom_source_get_status(source, &status), FATHOM_OK);
    return (fathom_source_state)status.state;
}

/* Something comes within five seconds. */
static void gives_something(fathom_source *source, void (*stir)(void)) {
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    fathom_imu_sample sample;
    int result = FATHOM_ERROR_TIMEOUT;
    for (int i = 0; i < 500 && result == FATHOM_ERROR_TIMEOUT; i++) {
        if (stir) stir();
        result = fathom_source_wait(source, 10);
    }
    assert_int_equal(result, FATHOM_OK);
    const bool depth = fathom_source_read_depth(source, &frame) == FATHOM_OK;
    assert_true(fathom_source_read_imu(source, &sample, 1) == 1 || depth);
}

static void is_at_rest(fathom_source *source) {
    assert_int_equal(state_of(source), FATHOM_SOURCE_STOPPED);
    assert_int_equal(fathom_source_stop(source), FATHOM_OK);
}

static void runs_and_refuses_a_second_start(fathom_source *source, void (*stir)(void)) {
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    errors = 0;
    assert_int_equal(fathom_source_start(source), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(errors, 1);
    assert_int_equal(state_of(source), FATHOM_SOURCE_RUNNING); /* as if it hadn't been asked */
    gives_something(source, stir);
    assert_int_equal(fathom_source_start(source), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_stop(source), FATHOM_OK);
}

void check_source_contract(const char *uri, void (*stir)(void)) {
    /* Recordings at a hundredth of their speed, so that none ends while it is looked at. */
    const fathom_source_options options = {.struct_size = sizeof options, .speed = 0.01, .log = count_errors};
    fathom_source *source;
    assert_int_equal(fathom_source_open(&source, uri, &options), FATHOM_OK);
    is_at_rest(source);
    assert_int_equal(fathom_source_wait(source, 1000), FATHOM_ERROR_ARGUMENT); /* nothing can come */
    for (int round = 0; round < 2; round++) {
        runs_and_refuses_a_second_start(source, stir);
        is_at_rest(source);
    }
    fathom_source_close(source); /* stopped */
    assert_int_equal(fathom_source_open(&source, uri, &options), FATHOM_OK);
    fathom_source_close(source); /* never started */
    assert_int_equal(fathom_source_open(&source, uri, &options), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    fathom_source_close(source); /* running */
}
