#include "align/align.h"

#include <math.h>
#include <string.h>

#include "base/covariance.h"

/* Neighbouring pixels share their noise (smoothing, correlated disparities), and the model isn't exact: this number of
 * pairs counts as one in the covariance. */
#define CORRELATED_PAIRS 50.0

void aligner_init(aligner *a, device *d, arena *block, const fathom_config *config, const depth_maps *maps) {
    memset(a, 0, sizeof *a);
    a->config = config;
    device_buffer_make(d, block, (size_t)maps->camera[FINEST].height * SUMS * 4, &a->sums);
    if (d->context) a->reduce = device_kernel(d, "align_reduce");
}

void aligner_close(aligner *a) {
    if (a->reduce) clReleaseKernel(a->reduce);
    device_buffer_free(&a->sums);
}

#define LEARNING_RATE 0.1 /* weight of a frame in the logarithm of the shared error */

void aligner_reset(aligner *a) {
    a->shared_m = 0;
    a->learnt = 0;
}

void aligner_learn(aligner *a, const alignment *trusted) {
    if (!(trusted->shared_m > 0)) return;
    const double rate = fmax(LEARNING_RATE, 1.0 / (1 + a->learnt));
    a->shared_m =
        a->learnt == 0 ? trusted->shared_m : a->shared_m * pow(trusted->shared_m / a->shared_m, rate);
    a->learnt++;
}

/* Maximum sigma of a start's position: pairs are searched within three of it, since the cost of rays is proportional to
 * their length. With 0.05 a wrong pose passed (tests/unit/tracking/test_faults.c): misfits must be visible. */
#define MOST_SIGMA_M 0.2

/* Pairs further apart than this are rejected; twice as far at each coarser level. */
static double pair_distance(const aligner *a, int level, double position_sigma_m) {
    double sigma = fmin(position_sigma_m, MOST_SIGMA_M);
    return fmax(a->config->max_pair_distance_m, 3 * sigma) * (1 << (FINEST - level));
}

float align_reach(const aligner *a, int coarsest, double position_sigma_m) {
    return (float)pair_distance(a, coarsest, position_sigma_m);
}

void align_reduce(aligner *a, device *d, depth_maps *maps, int level, const pose *motion,
                  const device_buffer *model, const kernel_camera *model_camera, double distance,
                  double huber_m, const double centre[3], normal_equations *e) {
    const fathom_config *c = a->config;
    const kernel_camera *camera = &maps->camera[level];
    kernel_pair_limits limits = {
        (cl_float)(distance * distance), cosf(c->max_pair_angle_rad), (cl_float)huber_m, {{0}}};
    for (int i = 0; i < 3; i++) limits.centre.s[i] = (cl_float)centre[i];
    kernel_rigid rigid = kernel_rigid_of(motion);
    RUN(d, a->reduce, (size_t)d->group, (size_t)camera->height, (size_t)d->group,
        ARG(maps->depth[level].memory), ARG(maps->normals[level].memory), ARG(*camera), ARG(model->memory),
        ARG(*model_camera), ARG(rigid), ARG(limits), ARG(a->sums.memory));
    memset(e, 0, sizeof *e);
    for (int i = 0; i < 3; i++) e->centre[i] = limits.centre.s[i];
    float *sums = device_map(d, &a->sums, CL_MAP_READ);
    for (int row = 0; sums && row < camera->height; row++) {
        const float *strip = sums + row * SUMS;
        normal_equations_add(e, strip, row * SOLVE_BANDS / camera->height);
        if (row % ACROSS_EVERY == 0) normal_equations_add_across(e, strip, strip + SUMS_ACROSS);
    }
    device_unmap(d, &a->sums, sums);
    normal_equations_total(e);
}

/* While an iteration moves the pose by more than SETTLED_SIGMAS, there may be MORE times as many as budgeted. */
#define SETTLED_SIGMAS 1.0
#define MORE 4

/* The i-th iteration at a level was its last. held: by a prior, so that s->covariance is in true units. */
static bool finished(const fathom_config *c, int i, int budget, const solution *s, bool held,
                     double last_error, double error) {
    const pose update = pose_exp(s->twist);
    const bool small = pose_angle(&update) < c->min_update_rad && pose_distance(&update) < c->min_update_m;
    const bool level_error = last_error - error < c->min_error_decrease * last_error;
    if (held && covariance_mahalanobis(s->covariance, s->twist) > SETTLED_SIGMAS) return i >= MORE * budget;
    return i >= budget || small || level_error;
}

void align(aligner *a, device *d, depth_maps *maps, const device_buffer model[FATHOM_LEVELS],
           const pose *start, const align_prior *known, const int budget[FATHOM_LEVELS], alignment *result) {
    const fathom_config *c = a->config;
    const double sigma = covariance_position_sigma(known->covariance);
    double centre[3] = {0, 0, 1.5}; /* near the pairs; later their centroid */
    memset(result, 0, sizeof *result);
    result->motion = *start;
    result->condition = INFINITY;
    for (int level = 0; level < FATHOM_LEVELS; level++) {
        double last_error = INFINITY;
        bool done = budget[level] == 0;
        for (int i = 1; !done; i++) {
            normal_equations e;
            solution s;
            solve_prior prior = {.correlated = CORRELATED_PAIRS,
                                 .converging = true,
                                 .since_s = known->since_s,
                                 .max_sigma_m = c->max_sigma_m,
                                 .shared_m = a->shared_m};
            align_reduce(a, d, maps, level, &result->motion, &model[level], &maps->camera[level],
                         pair_distance(a, level, sigma), c->huber_m, centre, &e);
            result->iterations++;
            result->pairs = (int)e.pairs;
            result->overlap = (int)e.overlap;
            result->pixels = maps->camera[level].width * maps->camera[level].height;
            result->weight = e.weight;
            bool held = c->prior == FATHOM_PRIOR_INFORMATION &&
                        prior_of_twist(known, &result->motion, prior.mean, prior.information);
            bool solved = solve_alignment(&e, held ? &prior : NULL, &s);
            const double error = s.residual / e.weight;
            done = finished(c, i, budget[level], &s, held, last_error, error);
            last_error = error;
            if (solved && held && done && level == FINEST) { /* what remains is what the surface tells */
                prior.converging = false;
                solved = solve_alignment(&e, &prior, &s);
            }
            memcpy(result->singular, s.singular, sizeof s.singular);
            result->condition = s.condition;
            result->shared_m = s.shared_m;
            if (!solved || d->error != FATHOM_OK) break;
            for (int k = 0; k < 3; k++) centre[k] += e.point[k] / e.weight;

            pose update = pose_exp(s.twist);
            result->motion = pose_multiply(&update, &result->motion);
            pose_normalise(&result->motion);
            result->rms = sqrt(s.residual / e.weight);
            if (!held) { /* variance of a pair of weight 1, from the residual */
                double variance = s.residual / fmax(e.pairs - 6, 1) * CORRELATED_PAIRS;
                for (int k = 0; k < 36; k++) s.covariance[k] *= variance;
            }
            covariance_to_scan(&result->motion, s.covariance, result->covariance);
            if (held) {
                information_to_scan(&result->motion, s.information, result->information);
                pull_to_scan(&result->motion, s.pull, result->pull);
                twist_to_scan(&result->motion, s.weakest, result->weakest);
                result->weakest_sigma_m = s.weakest_sigma_m;
                result->observed = s.observed;
            } else {
                covariance_invert(result->covariance, result->information);
            }
        }
    }
}

/* y += m x */
static void add_product(const double m[36], const double x[6], double y[6]) {
    for (int i = 0; i < 36; i++) y[i / 6] += m[i] * x[i % 6];
}

/* With x from the present result, d to the prior's mean, P its covariance and Y the pairs' information:
 * (P^-1 + trust Y) x = P^-1 d + trust pull. */
void align_trust_less(alignment *a, const align_prior *known, double trust) {
    const pose way = pose_between(&a->motion, &known->mean);
    double prior[36], joint[36], less[36], to_mean[6], right[6], twist[6] = {0};
    if (!covariance_invert(known->covariance, prior)) return;
    pose_log(&way, to_mean);
    for (int i = 0; i < 36; i++) {
        a->information[i] *= trust;
        joint[i] = prior[i] + a->information[i];
        less[i] = -a->information[i];
    }
    for (int i = 0; i < 6; i++) right[i] = a->pull[i] *= trust;
    add_product(prior, to_mean, right);
    if (!covariance_invert(joint, a->covariance)) return;
    add_product(a->covariance, right, twist);
    add_product(less, twist, a->pull);
    const pose correction = pose_exp(twist);
    a->motion = pose_multiply(&a->motion, &correction);
    pose_normalise(&a->motion);
}
