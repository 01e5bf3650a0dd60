/* fathom devices: what each driver sees, what it lacks, and the fix. */
#include "fathom/shell/cli.h"
#include "fathom_drivers.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

#include <stdio.h>
#include <string.h>

struct listing {
    bool json;
    int lines;
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
    print_string("error", info->error ? fathom_source_error_name(info->error) : "");
    print_string("problem", info->problem);
    printf("}\n");
}

static int print_found(void *user, const fathom_source_info *info) {
    struct listing *listing = user;
    listing->lines++;
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

static void help(void) {
    puts("usage: fathom devices [--json]\n\n"
         "Lists the depth cameras and inertial sensors that each driver sees, and what keeps others from "
         "being\n"
         "used, with the fix.\n\n"
         "    --json     a line of JSON for each\n"
         "    --verbose  say more on stderr");
}

int command_devices(int argc, char **argv) {
    struct options options = {.count = argc, .arguments = argv, .at = 1};
    struct listing listing = {0};
    struct cli_log log = {0};
    while (options_next(&options)) {
        if (strcmp(options.name, "--help") == 0 || strcmp(options.name, "-h") == 0) {
            help();
            return CLI_DONE;
        }
        if (!options.name[0]) return cli_error(CLI_USAGE, "devices: takes no %s", options.value);
        if (strcmp(options.name, "--json") == 0) {
            if (!(listing.json = options_flag(&options))) return CLI_USAGE;
        } else if (strcmp(options.name, "--verbose") == 0) {
            if (!(log.verbose = options_flag(&options))) return CLI_USAGE;
        } else {
            return cli_error(CLI_USAGE, "devices: unknown option %s; fathom devices --help lists them",
                             options.name);
        }
    }
    const int seen = fathom_sources_enumerate(NULL, print_found, &listing, log_message, &log);
    return seen < 0 ? cli_error(CLI_FAILED, "%s", *log.error ? log.error : fathom_source_error_name(seen))
                    : CLI_DONE;
}
