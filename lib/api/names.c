/* Version and names. */
#include "fathom.h"

#define STRING_(x) #x
#define STRING(x) STRING_(x)

const char *fathom_version(void) {
    return STRING(FATHOM_VERSION_MAJOR) "." STRING(FATHOM_VERSION_MINOR) "." STRING(FATHOM_VERSION_PATCH);
}

const char *fathom_error_name(int32_t error) {
#define NAME(error)                                                                                          \
    case error: return #error
    switch (error) {
        NAME(FATHOM_OK);
        NAME(FATHOM_ERROR_ARGUMENT);
        NAME(FATHOM_ERROR_CONFIG);
        NAME(FATHOM_ERROR_MEMORY);
        NAME(FATHOM_ERROR_DEVICE);
        NAME(FATHOM_ERROR_KERNEL);
        NAME(FATHOM_ERROR_TIME);
        NAME(FATHOM_ERROR_SIZE);
        NAME(FATHOM_ERROR_STOPPED);
        NAME(FATHOM_ERROR_NO_DATA);
        NAME(FATHOM_ERROR_FULL);
        NAME(FATHOM_ERROR_NAME);
        NAME(FATHOM_ERROR_VALUE);
        NAME(FATHOM_ERROR_WRITE);
        NAME(FATHOM_ERROR_TIMEOUT);
        NAME(FATHOM_ERROR_CANCELLED);
        NAME(FATHOM_ERROR_ENDED);
        NAME(FATHOM_ERROR_UNPLUGGED);
        NAME(FATHOM_ERROR_PERMISSION);
        NAME(FATHOM_ERROR_BUSY);
        NAME(FATHOM_ERROR_NO_DEVICE);
        NAME(FATHOM_ERROR_NOT_BUILT);
        NAME(FATHOM_ERROR_PROTOCOL);
        NAME(FATHOM_ERROR_UNSUPPORTED);
    }
#undef NAME
    return error > 0 ? "FATHOM_OK" : "FATHOM_ERROR_UNKNOWN";
}

const char *fathom_state_name(int32_t state) {
    static const char *const names[] = {"first", "tracked", "reckoned", "lost"};
    return (uint32_t)state < 4 ? names[state] : "unknown";
}

const char *fathom_verdict_name(int32_t verdict) {
    static const char *const names[] = {"tracking",  "no depth",   "few pairs",     "overlap",  "residual",
                                        "condition", "innovation", "contradiction", "uncertain", "device"};
    return (uint32_t)verdict < 10 ? names[verdict] : "unknown";
}

const char *fathom_imu_health_name(int32_t health) {
    static const char *const names[] = {"unchecked", "good", "saturated", "units", "scale",    "axes",
                                        "mounting",  "sign", "clock",     "stuck", "unrelated"};
    return (uint32_t)health < 11 ? names[health] : "unknown";
}
