#include "fathom/live/live_rig.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/clock.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#define SLICE_MS 100            /* interval of checks for the end */
#define SAMPLES_WAIT_NS 5000000 /* maximum time that a frame waits for the samples up to its stamp */
#define SETTLE_NS 100000000     /* maximum time, at the end, for one beyond it */

/* ---- opening ---- */

struct search {
    unsigned kind;
    char uri[256];
};

static int take_first(void *user, const fathom_source_info *info) {
    struct search *search = user;
    if (!(info->kinds & search->kind) || info->error) return 0;
    snprintf(search->uri, sizeof search->uri, "%s", info->uri);
    return 1;
}

static bool find_first(struct search *search, struct cli_log *log) {
    fathom_sources_enumerate(NULL, take_first, search, log_message, log);
    log_clear(log);
    return *search->uri;
}

static const char *reason(const struct cli_log *log, int error) {
    return *log->error ? log->error : fathom_error_name(error);
}

static int open_source(fathom_source **source, const char *uri, unsigned kind,
                       const struct live_options *options, struct cli_log *log) {
    const fathom_source_options how = {.struct_size = sizeof how, .kinds = kind,
                                       .reconnect = options->reconnect,
                                       .width = kind == FATHOM_SOURCE_DEPTH ? options->size.width : 0,
                                       .height = kind == FATHOM_SOURCE_DEPTH ? options->size.height : 0,
                                       .rate_hz = kind == FATHOM_SOURCE_DEPTH ? options->rate : 0,
                                       .speed = options->speed,
                                       .frame_capacity = options->frame_capacity,
                                       .imu_capacity = options->imu_capacity,
                                       .log = log_message,
                                       .log_user = log};
    log_clear(log);
    return fathom_source_open(source, uri, &how);
}

static int open_depth(struct live_rig *rig, const char **uri, struct search *search,
                      const struct live_options *options, struct cli_log *log) {
    search->kind = FATHOM_SOURCE_DEPTH;
    if (!*uri && !find_first(search, log))
        return cli_error(CLI_FAILED, "no depth camera can be opened; fathom devices says why");
    if (!*uri) *uri = search->uri;
    const int result = open_source(&rig->depth, *uri, FATHOM_SOURCE_DEPTH, options, log);
    if (result)
        return cli_error(result == FATHOM_ERROR_ARGUMENT ? CLI_USAGE : CLI_FAILED, "%s", reason(log, result));
    if (options->verbose) cli_note("depth from %s", *uri);
    return CLI_DONE;
}

static bool is_folder(const char *uri) {
    struct stat is;
    return strncmp(uri, "folder:", 7) == 0 || (stat(uri, &is) == 0 && S_ISDIR(is.st_mode));
}

static bool is_recording(const char *uri) {
    const size_t length = strlen(uri);
    return is_folder(uri) || (length > 4 && strcmp(uri + length - 4, ".oni") == 0);
}

static int open_imu(struct live_rig *rig, const char *depth, const struct live_options *options,
                    struct cli_log *log) {
    struct search search = {.kind = FATHOM_SOURCE_IMU};
    const char *uri = options->imu;
    if (uri && !*uri) return CLI_DONE;
    if (!uri && is_folder(depth)) uri = depth; /* a rig of its own, when it has samples */
    if (!uri && find_first(&search, log)) uri = search.uri;
    const int result =
        uri ? open_source(&rig->imu, uri, FATHOM_SOURCE_IMU, options, log) : FATHOM_ERROR_NO_DEVICE;
    if (!result) {
        if (options->verbose) cli_note("inertial samples from %s", uri);
        rig->unpaced &= is_recording(uri);
        return CLI_DONE;
    }
    if (options->imu)
        return cli_error(result == FATHOM_ERROR_ARGUMENT ? CLI_USAGE : CLI_FAILED, "%s", reason(log, result));
    cli_note("no inertial sensor: going on without");
    log_clear(log);
    return CLI_DONE;
}

int live_rig_open(struct live_rig *rig, const struct live_options *options, struct cli_log *log) {
    struct search search = {0};
    const char *depth = options->depth;
    pthread_condattr_t attributes;
    *rig = (struct live_rig){.newest_ns = INT64_MIN};
    pthread_mutex_init(&rig->lock, NULL);
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&rig->pushed, &attributes);
    pthread_condattr_destroy(&attributes);
    const int status = open_depth(rig, &depth, &search, options, log);
    rig->unpaced = !status && options->speed == 0 && is_recording(depth);
    return status ? status : open_imu(rig, depth, options, log);
}

int live_rig_configure(struct live_rig *rig, const struct live_options *options, fathom_config *config,
                       struct cli_log *log) {
    fathom_source_configure(rig->depth, config);
    if (rig->imu) fathom_source_configure(rig->imu, config);
    config->imu = rig->imu != NULL;
    log_clear(log);
    const int result =
        options->rig ? fathom_rig_configure(options->rig, config, log_message, log) : FATHOM_OK;
    return result ? cli_error(CLI_FAILED, "%s", reason(log, result)) : CLI_DONE;
}

static const char *folder_of(const char *uri) {
    if (!uri || !is_folder(uri)) return NULL;
    return strncmp(uri, "folder:", 7) == 0 ? uri + 7 : uri;
}

const char *live_rig_mounting(const struct live_rig *rig, const struct live_options *options) {
    if (options->rig) return options->rig;
    const char *own = rig->imu ? folder_of(options->imu) : NULL;
    return own ? own : folder_of(options->depth);
}

/* ---- samples ---- */

/* Updates the sample period from the end of the batch. */
static void push(struct live_rig *rig, const fathom_imu_sample *samples, int count) {
    rig->take(rig->user, samples, count);
    const int64_t newest_ns = samples[count - 1].timestamp_ns + rig->clock_offset_ns;
    pthread_mutex_lock(&rig->lock);
    if (rig->samples > 0 && newest_ns > rig->newest_ns) rig->period_ns = (newest_ns - rig->newest_ns) / count;
    rig->newest_ns = newest_ns;
    rig->samples += count;
    pthread_cond_broadcast(&rig->pushed);
    pthread_mutex_unlock(&rig->lock);
}

static void end_samples(struct live_rig *rig, int why) {
    pthread_mutex_lock(&rig->lock);
    rig->ended = why;
    pthread_cond_broadcast(&rig->pushed);
    pthread_mutex_unlock(&rig->lock);
}

static void *gather_samples(void *user) {
    struct live_rig *rig = user;
    fathom_imu_sample samples[64];
    int result;
    do {
        result = fathom_source_wait(rig->imu, -1);
        for (int n; !result && (n = fathom_source_read_imu(rig->imu, samples, 64)) > 0;)
            push(rig, samples, n);
    } while (!result || result == FATHOM_ERROR_TIMEOUT);
    end_samples(rig, result);
    return NULL;
}

int live_rig_start(struct live_rig *rig, int64_t clock_offset_ns, live_rig_take take, void *user,
                   struct cli_log *log) {
    rig->take = take;
    rig->user = user;
    rig->clock_offset_ns = clock_offset_ns;
    log_clear(log);
    int result = rig->imu ? fathom_source_start(rig->imu) : FATHOM_OK;
    if (!result) result = fathom_source_start(rig->depth);
    if (result) return cli_error(CLI_FAILED, "%s", reason(log, result));
    if (!rig->imu || rig->unpaced) return CLI_DONE;
    if (pthread_create(&rig->thread, NULL, gather_samples, rig))
        return cli_error(CLI_FAILED, "no thread could be made");
    rig->threaded = true;
    return CLI_DONE;
}

/* Pushes samples up to one beyond the stamp, as in a replay. */
static void pull_until(struct live_rig *rig, int64_t stamp_ns) {
    while (!rig->ended && rig->newest_ns <= stamp_ns) {
        if (rig->kept_next < rig->kept_count) {
            push(rig, &rig->kept[rig->kept_next++], 1);
            continue;
        }
        const int result = fathom_source_wait(rig->imu, SLICE_MS);
        if (result == FATHOM_ERROR_TIMEOUT && cli_interrupted()) break;
        if (result && result != FATHOM_ERROR_TIMEOUT) end_samples(rig, result);
        rig->kept_next = 0;
        rig->kept_count = result ? 0 : fathom_source_read_imu(rig->imu, rig->kept, 64);
    }
}

void live_rig_push_until(struct live_rig *rig, int64_t stamp_ns) {
    if (!rig->imu) return;
    if (rig->unpaced) {
        pull_until(rig, stamp_ns);
        return;
    }
    const struct timespec until = clock_timespec(clock_now_ns() + SAMPLES_WAIT_NS);
    pthread_mutex_lock(&rig->lock);
    /* Without a sample for many periods the sensor is silent, and waiting is useless. */
    const bool alive = rig->newest_ns > stamp_ns - 10 * rig->period_ns - SAMPLES_WAIT_NS;
    while (alive && !rig->ended && rig->newest_ns + rig->period_ns < stamp_ns)
        if (pthread_cond_timedwait(&rig->pushed, &rig->lock, &until)) break;
    pthread_mutex_unlock(&rig->lock);
}

void live_rig_settle(struct live_rig *rig, int64_t stamp_ns) {
    if (!rig->threaded) {
        live_rig_push_until(rig, stamp_ns);
        return;
    }
    const struct timespec until = clock_timespec(clock_now_ns() + SETTLE_NS);
    pthread_mutex_lock(&rig->lock);
    while (!rig->ended && rig->newest_ns <= stamp_ns)
        if (pthread_cond_timedwait(&rig->pushed, &rig->lock, &until)) break;
    pthread_mutex_unlock(&rig->lock);
}

int live_rig_end(int waited, const struct cli_log *log) {
    if (!waited || waited == FATHOM_ERROR_TIMEOUT || waited == FATHOM_ERROR_ENDED) return CLI_DONE;
    if (waited == FATHOM_ERROR_UNPLUGGED) return cli_error(CLI_FAILED, "the depth camera was unplugged");
    return cli_error(CLI_FAILED, "%s", reason(log, waited));
}

void live_rig_stop(struct live_rig *rig) {
    if (rig->threaded) {
        fathom_source_cancel(rig->imu);
        pthread_join(rig->thread, NULL);
    }
    rig->threaded = false;
}

void live_rig_close(struct live_rig *rig) {
    live_rig_stop(rig);
    fathom_source_close(rig->depth);
    fathom_source_close(rig->imu);
    pthread_cond_destroy(&rig->pushed);
    pthread_mutex_destroy(&rig->lock);
    *rig = (struct live_rig){0};
}
