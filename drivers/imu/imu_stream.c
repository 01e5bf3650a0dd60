#include "imu/imu_stream.h"

#include <math.h>

#define BACK_LEAP_NS 50000000 /* a device stamp earlier than the last by this is another clock's, not a late one */

static void push(void *user, const fathom_imu_sample *sample) {
    imu_stream *s = user;
    fathom_imu_sample in_order = *sample;
    if (in_order.timestamp_ns <= s->pushed_ns) in_order.timestamp_ns = s->pushed_ns + 1;
    s->pushed_ns = in_order.timestamp_ns;
    source_queue_push_imu(s->queue, &in_order);
}

void imu_stream_init(imu_stream *stream, source_queue *queue) {
    *stream = (imu_stream){.queue = queue, .pushed_ns = INT64_MIN};
    pthread_mutex_init(&stream->lock, NULL);
    imu_stream_restart(stream, false);
}

void imu_stream_free(imu_stream *stream) {
    pthread_mutex_destroy(&stream->lock);
}

void imu_stream_restart(imu_stream *stream, bool accel_only) {
    pthread_mutex_lock(&stream->lock);
    clock_map_reset(&stream->clock);
    stream->timed = false;
    pthread_mutex_unlock(&stream->lock);
    stream->accel_only = accel_only;
    stream->gyro = stream->accel = stream->both = (imu_stream_last){0};
    imu_pair_init(&stream->pair, push, stream);
}

/* The device's stamp of each sample, from all stamps or the last one. False: the last one isn't later than the previous
 * report's. */
static bool device_stamps(const imu_reading *r, const imu_stream_last *last, int64_t stamps[IMU_BATCH]) {
    const int n = r->samples;
    for (int i = 0; i < n; i++) stamps[i] = r->device_ns[i];
    const int64_t step = stamps[n - 1] - last->device_ns;
    if (last->host_ns && step <= 0 && step > -BACK_LEAP_NS) return false;
    if (r->times < n) {
        int64_t period = r->period_ns;
        if (!period && last->host_ns && step > 0) period = step / n;
        for (int i = n - 2; i >= 0; i--) stamps[i] = stamps[i + 1] - period;
    }
    return true;
}

/* Each sample's stamp on the host's clock. Only one sensor's stamps update the clock map: those of two sensors aren't
 * ordered. */
static bool host_stamps(imu_stream *s, const imu_reading *r, imu_stream_last *last, int64_t arrival_ns,
                        int64_t stamps[IMU_BATCH]) {
    const int n = r->samples;
    if (r->times) {
        if (!device_stamps(r, last, stamps)) return false;
        const int64_t device_ns = stamps[n - 1];
        pthread_mutex_lock(&s->lock);
        if (r->has_gyro || s->accel_only || !s->timed) clock_map_stamp(&s->clock, device_ns, arrival_ns);
        s->timed = true;
        for (int i = 0; i < n; i++) stamps[i] = clock_map_at(&s->clock, stamps[i]);
        pthread_mutex_unlock(&s->lock);
        last->device_ns = device_ns;
    } else {
        int64_t period = r->period_ns;
        if (!period && last->host_ns) period = (arrival_ns - last->host_ns) / n;
        for (int i = 0; i < n; i++) stamps[i] = arrival_ns - (n - 1 - i) * period;
    }
    last->host_ns = stamps[n - 1];
    return true;
}

/* False: not later than the sensor's last one. */
static bool take_one(imu_stream *s, const imu_reading *r, int i, int64_t stamp_ns) {
    if (r->has_gyro && !r->has_accel) return imu_pair_gyro(&s->pair, stamp_ns, r->gyro[i]);
    if (!r->has_gyro && !s->accel_only) return imu_pair_accel(&s->pair, stamp_ns, r->accel[i]);
    fathom_imu_sample sample = {.timestamp_ns = stamp_ns};
    for (int k = 0; k < 3; k++) {
        sample.gyro[k] = r->has_gyro ? (float)r->gyro[i][k] : NAN;
        sample.accel[k] = (float)r->accel[i][k];
    }
    push(s, &sample);
    return true;
}

void imu_stream_take(imu_stream *stream, const imu_reading *reading, int64_t arrival_ns) {
    imu_stream_last *last = reading->has_gyro && reading->has_accel ? &stream->both
                            : reading->has_gyro                     ? &stream->gyro
                                                                    : &stream->accel;
    int64_t stamps[IMU_BATCH];
    int dropped = 0;
    if (reading->lost) source_queue_count_lost(stream->queue, reading->lost);
    if (!host_stamps(stream, reading, last, arrival_ns, stamps))
        dropped = reading->samples;
    else
        for (int i = 0; i < reading->samples; i++) dropped += !take_one(stream, reading, i, stamps[i]);
    if (dropped) source_queue_count_malformed(stream->queue, dropped);
}

void imu_stream_status(imu_stream *stream, fathom_source_status *status) {
    pthread_mutex_lock(&stream->lock);
    status->clock_offset_s = stream->timed ? clock_map_offset_s(&stream->clock) : 0;
    status->clock_drift_ppm = stream->timed ? clock_map_drift_ppm(&stream->clock) : 0;
    pthread_mutex_unlock(&stream->lock);
}
