/* fathom devices: each driver's devices, its problems, and the fix. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom_drivers.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

#include <stdio.h>
#include <string.h>

struct listing {
    bool json, verbose;
};

static const char *kinds_of(unsigned kinds) {
    const bool depth = kinds & FATHOM_SOURCE_DEPTH, imu = kinds & FATHOM_SOURCE_IMU;
    return depth && imu ? "depth+imu" : depth ? "depth" : imu ? "imu" : "";
}

static void print_string(const char *name, const char *text) {
    printf(",\"%s\":\"", name);
    for (; *text; text++) {
        if (*text == '"' || *text == '\\')
            printf("\\%c", *text);
        else if ((unsigned char)*text < ' ')
            printf("\\u%04x", *text);
        else
            putchar(*text);
    }
    putchar('"');
}

static void print_json(const fathom_source_info *info) {
    printf("{\"device\":%s", info->kinds ? "true" : "false");
    print_string("driver", info->driver);
    print_string("kinds", kinds_of(info->kinds));
    print_string("uri", info->uri);
    print_string("name", info->name);
    print_string("serial", info->serial);
    print_string("error", info->error ? fathom_error_name(info->error) : "");
    print_string("problem", info->problem);
    printf("}\n");
}

static int print_found(void *user, const fathom_source_info *info) {
    const struct listing *listing = user;
    if (listing->json) {
        print_json(info);
        return 0;
    }
    if (info->kinds) {
        printf("%s: %s", kinds_of(info->kinds), info->name);
        if (*info->serial) printf(", serial %s", info->serial);
        printf("\n");
        if (*info->uri)
            printf("    --%s %s\n", info->kinds & FATHOM_SOURCE_DEPTH ? "depth" : "imu", info->uri);
    } else {
        printf("%s: %s\n", info->driver, info->name);
    }
    if (*info->problem) printf("    %s\n", info->problem);
    return 0;
}

#define AT(field) offsetof(struct listing, field)

static const struct option_row own[] = {
    {"--json", NULL, OPTION_FLAG, AT(json), .help = "a line of JSON for each"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};

static const struct option_group groups[] = {{"Options", own, 0}, {0}};

static int run(const struct command *command, int argc, char **argv) {
    struct listing listing = {0};
    const int status = options_read(command, &listing, argc, argv);
    if (status) return status;
    struct cli_log log = {.verbose = listing.verbose};
    const int seen = fathom_sources_enumerate(NULL, print_found, &listing, log_message, &log);
    return seen < 0 ? cli_error(CLI_FAILED, "%s", *log.error ? log.error : fathom_error_name(seen))
                    : CLI_DONE;
}

const struct command command_devices = {
    .name = "devices",
    .summary = "depth cameras and inertial sensors, and what they lack",
    .about = "Lists the depth cameras and inertial sensors that each driver sees, and what keeps others "
             "from being used, with the fix.",
    .groups = groups,
    .run = run};
