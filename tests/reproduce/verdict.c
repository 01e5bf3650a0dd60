/* How well the verdict tells right alignments from wrong ones. A recording is tracked; at each frame whose tracked pose is
 * sure, before it is fused, that pose and misalignments injected from it are judged: as they are, and aligned from there.
 * Stdout: a CSV line for each candidate, after a line of names.
 * Usage: verdict FOLDER [--stride N] [--each N] [--within M] [--seed N]
 *     --each     judges at every Nth frame taken
 *     --within   leaves out frames whose tracked pose is further from groundtruth.txt (0.01 m; and 0.7 degrees for each cm)
 * Works on the library's insides: the measures that decide are wanted of rejected candidates too. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "fathom/replay/playback.h"
#include "context.h"
#include "base/covariance.h"

#define DEGREES 57.29577951308232
#define ALIGNED 6  /* candidates of a frame: aligned from an injected misalignment */
#define INJECTED 3 /* and left there */

#define CORRELATED_PAIRS 50.0 /* as lib/align/align.c counts them */

/* Right and wrong, and between them neither. */
#define RIGHT_M 0.01
#define RIGHT_DEG 0.7
#define WRONG_M 0.03
#define WRONG_DEG 2.0

/* How far candidates are moved: log-uniform, a translation, a rotation or both. */
static const double least_m = 0.03, most_m = 0.3, least_rad = 2 / DEGREES, most_rad = 20 / DEGREES;
#define OTHER_M 0.03 /* sigma of what isn't moved */
#define OTHER_RAD 0.03

struct run {
    const char *name;
    fathom_recording *recording;
    struct playback playback;
    int stride, each;
    double within;
    uint64_t seed;
    pose first_truth;
    int frames, tracked, sure; /* taken; of these; of these */
};

/* A misalignment and the covariance of a seed that is so far off. */
struct injection {
    pose off;
    double metres, radians, covariance[36];
};

static double log_uniform(uint64_t key, uint64_t counter, double least, double most) {
    return least * pow(most / least, random_uniform(key, counter));
}

static void direction(uint64_t key, uint64_t counter, double length, double out[3]) {
    double norm = 0;
    for (int i = 0; i < 3; i++) {
        out[i] = random_normal(key, counter + (uint64_t)i);
        norm += out[i] * out[i];
    }
    for (int i = 0; i < 3; i++) out[i] *= length / sqrt(norm);
}

static void inject(uint64_t key, int number, struct injection *in) {
    double twist[6];
    memset(in, 0, sizeof *in);
    if (number % 3 != 1) in->metres = log_uniform(key, 16 * (uint64_t)number, least_m, most_m);
    if (number % 3 != 0) in->radians = log_uniform(key, 16 * (uint64_t)number + 8, least_rad, most_rad);
    direction(key, 32 * (uint64_t)number + 1, in->radians, twist);
    direction(key, 32 * (uint64_t)number + 5, in->metres, twist + 3);
    in->off = pose_exp(twist);
    for (int i = 0; i < 6; i++) {
        const double sigma = i < 3 ? fmax(in->radians, OTHER_RAD) : fmax(in->metres, OTHER_M);
        in->covariance[7 * i] = sigma * sigma;
    }
}

static void compare(fathom *f, const pose *at, comparison *k) {
    const fathom_config *c = &f->config;
    model_view_compare(&f->tracker.view, &f->device, &f->maps, &f->raycaster, at, c->agreement_tolerance_m + c->voxel_m, k);
}

/* What alignment would say of a pose if it stopped there. */
static void judge_in_place(fathom *f, const pose *at, const double covariance[36], attempt *a) {
    alignment *icp = &a->icp;
    const fathom_config *c = &f->config;
    const pose here = pose_identity();
    const double centre[3] = {0, 0, 1.5};
    const kernel_camera *camera = &f->maps.camera[FINEST];
    solve_prior prior = {.correlated = CORRELATED_PAIRS};
    normal_equations e;
    solution s;
    comparison k;
    const double sigma = sqrt(covariance[35]), reach = fmax(c->max_pair_distance_m, 3 * sigma);
    memset(a, 0, sizeof *a);
    raycast_near(&f->raycaster, &f->device, &f->maps, at, (float)reach, true, &f->tracker.models.level[FINEST]);
    align_reduce(&f->tracker.aligner, &f->device, &f->maps, FINEST, &here, &f->tracker.models.level[FINEST], camera, reach,
                 c->huber_m, centre, &e);
    icp->motion = *at;
    icp->pairs = (int)e.pairs;
    icp->overlap = (int)e.overlap;
    icp->pixels = camera->width * camera->height;
    icp->rms = sqrt(e.btb / e.weight);
    icp->condition = INFINITY;
    for (int i = 0; i < 6; i++) icp->covariance[7 * i] = INFINITY;
    if (covariance_invert(covariance, prior.information) && solve_alignment(&e, &prior, &s)) {
        icp->condition = s.condition;
        memcpy(icp->covariance, s.covariance, sizeof s.covariance);
    }
    compare(f, at, &k);
    a->verdict = judge_alignment(c, icp, 0);
    if (a->verdict == FATHOM_VERDICT_TRACKING) a->verdict = judge_view(c, &k);
    if (a->verdict == FATHOM_VERDICT_TRACKING) a->verdict = judge_certainty(c, icp->covariance);
}

static const char *label_of(double metres, double degrees) {
    if (metres < RIGHT_M && degrees < RIGHT_DEG) return "right";
    return metres >= WRONG_M || degrees >= WRONG_DEG ? "wrong" : "between";
}

static double largest_sigma(const double covariance[36], int from) {
    return sqrt(fmax(covariance[7 * from], fmax(covariance[7 * from + 7], covariance[7 * from + 14])));
}

static void print(const struct run *run, int frame, const char *kind, const struct injection *in,
                  const pose *reference, const attempt *a) {
    fathom *f = run->playback.library.scan;
    const alignment *icp = &a->icp;
    const pose way = pose_between(reference, &icp->motion);
    const double metres = pose_distance(&way), degrees = DEGREES * pose_angle(&way);
    const kernel_camera *c = &f->maps.camera[0];
    comparison k;
    compare(f, &icp->motion, &k);
    const double seen = k.visible > 0 ? k.visible : 1;
    printf("%s,%d,%s,%s,%.4f,%.3f,%.5f,%.4f,", run->name, frame, kind, label_of(metres, degrees), in->metres,
           DEGREES * in->radians, metres, degrees);
    printf("%.5f,%.6f,%.3f,%.5f,%.5f,%.5f,%.5f,%.4f,%.3f,%s\n",
           icp->overlap > 0 ? (double)icp->pairs / icp->overlap : 0, icp->rms, icp->condition,
           largest_sigma(icp->covariance, 3), largest_sigma(icp->covariance, 0), k.agree / seen,
           k.through / seen, k.visible / (c->width * c->height), a->innovation,
           fathom_verdict_name(a->verdict));
}

static void candidates(const struct run *run, int frame, const fathom_result *tracked) {
    fathom *f = run->playback.library.scan;
    const pose reference = f->pose;
    const uint64_t key = random_key(run->seed, (uint64_t)frame);
    struct injection in = {.off = pose_identity()};
    attempt a = {.icp = {.motion = reference, .pairs = tracked->pairs, .overlap = tracked->overlap_pixels},
                 .innovation = tracked->innovation_sigmas};
    a.icp.rms = tracked->rms_m;
    a.icp.condition = tracked->condition;
    memcpy(a.icp.covariance, f->covariance, sizeof a.icp.covariance);
    print(run, frame, "tracked", &in, &reference, &a);
    for (int i = 0; i < ALIGNED + INJECTED; i++) {
        align_prior prior = {0};
        inject(key, i, &in);
        prior.mean = pose_multiply(&reference, &in.off);
        memcpy(prior.covariance, in.covariance, sizeof prior.covariance);
        if (i < ALIGNED)
            track_attempt(&f->tracker, &prior.mean, &prior, false, &a);
        else
            judge_in_place(f, &prior.mean, in.covariance, &a);
        print(run, frame, i < ALIGNED ? "aligned" : "injected", &in, &reference, &a);
    }
}

static bool truth_at(const struct run *run, int64_t stamp_ns, pose *truth) {
    fathom_pose p;
    if (fathom_recording_pose_at(run->recording, stamp_ns, &p) != FATHOM_OK) return false;
    return pose_take(&p, truth);
}

static bool sure(const struct run *run, int64_t stamp_ns) {
    pose truth;
    if (!truth_at(run, stamp_ns, &truth)) return false;
    truth = pose_between(&run->first_truth, &truth);
    const pose off = pose_between(&truth, &run->playback.library.scan->pose);
    return pose_distance(&off) <= run->within && DEGREES * pose_angle(&off) <= 70 * run->within;
}

static int track_all(struct run *run, uint16_t *depth) {
    const fathom_recording *recording = run->recording;
    fathom *f = run->playback.library.scan;
    puts("recording,frame,kind,label,injected_m,injected_deg,off_m,off_deg,overlap,rms_m,condition,sigma_m,"
         "sigma_"
         "rad,agreement,see_through,visible,innovation,verdict");
    for (int i = 0; i < recording->frame_count; i += run->stride) {
        const int64_t now = recording->frames[i].timestamp_ns;
        const fathom_depth_frame scan = {.struct_size = sizeof scan,
                                         .timestamp_ns = now,
                                         .depth = depth,
                                         .width = recording->camera.width,
                                         .height = recording->camera.height,
                                         .row_stride_bytes = 2 * recording->camera.width};
        fathom_result r = FATHOM_STRUCT(fathom_result);
        playback_push_imu(&run->playback, recording, i);
        int error = fathom_recording_read_depth(recording, i, depth);
        if (error == FATHOM_OK) error = fathom_step(f, &scan, &r);
        if (error != FATHOM_OK) {
            fprintf(stderr, "verdict: frame %d: %s\n", i, fathom_error_name(error));
            return 1;
        }
        if (r.state == FATHOM_FIRST) {
            if (!truth_at(run, now, &run->first_truth)) {
                fprintf(stderr, "verdict: groundtruth.txt has no pose at the first frame\n");
                return 1;
            }
            fathom_pause(f, true); /* from here on frames are fused after the candidates were judged */
            continue;
        }
        run->frames++;
        if (r.state != FATHOM_TRACKED) continue;
        run->tracked++;
        if (sure(run, now)) {
            run->sure++;
            if (run->frames % run->each == 0) candidates(run, i, &r);
        }
        fuse(&f->fusing, &f->pose, &r);
    }
    fprintf(stderr, "frames=%d tracked=%d sure=%d\n", run->frames, run->tracked, run->sure);
    return f->device.error != FATHOM_OK;
}

int main(int argc, char **argv) {
    struct run run = {.stride = 1, .each = 1, .within = 0.01, .seed = 1};
    struct cli_log log = {0};
    struct settings settings;
    for (int i = 2; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--stride"))
            run.stride = atoi(argv[i + 1]);
        else if (!strcmp(argv[i], "--each"))
            run.each = atoi(argv[i + 1]);
        else if (!strcmp(argv[i], "--within"))
            run.within = atof(argv[i + 1]);
        else if (!strcmp(argv[i], "--seed"))
            run.seed = (uint64_t)atoll(argv[i + 1]);
        else
            argc = 0;
    }
    if (argc < 2 || argc % 2 || run.stride < 1 || run.each < 1) {
        fprintf(stderr, "usage: verdict FOLDER [--stride N] [--each N] [--within M] [--seed N]\n");
        return 2;
    }
    const char *slash = strrchr(argv[1], '/');
    run.name = slash ? slash + 1 : argv[1];
    settings_start(&settings);
    int failed = playback_open(&run.recording, argv[1], NULL, &settings, &log);
    if (!failed) failed = playback_start(&run.playback, run.recording, 0, run.stride, &settings, &settings.config, &log);
    if (!failed) {
        uint16_t *depth =
            malloc((size_t)run.recording->camera.width * (size_t)run.recording->camera.height * sizeof *depth);
        failed = depth ? track_all(&run, depth) : 1;
        free(depth);
    }
    playback_stop(&run.playback);
    fathom_recording_close(run.recording);
    return failed;
}
