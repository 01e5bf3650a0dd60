/* The tests that make up the verdict (lib/tracking/verdict.c), one by one: each fails alone, and holds at its threshold. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "api/settings.h"
#include "tracking/verdict.h"

static fathom_config config;

static int setup(void **state) {
    (void)state;
    fathom_config_init(&config);
    return 0;
}

/* An alignment that nothing can be said against, of 320 by 240 pixels. */
static alignment good(void) {
    alignment a = {.motion = pose_identity(), .pairs = 50000, .overlap = 60000, .pixels = 76800};
    a.rms = 0.003;
    a.condition = 5;
    for (int i = 0; i < 6; i++) a.covariance[7 * i] = 1e-6;
    return a;
}

static void a_good_alignment_is_tracking(void **state) {
    (void)state;
    alignment a = good();
    assert_int_equal(judge_alignment(&config, &a, 1), FATHOM_VERDICT_TRACKING);
    assert_int_equal(judge_certainty(&config, a.covariance), FATHOM_VERDICT_TRACKING);
}

static void one_pair_in_a_hundred_pixels_is_needed(void **state) {
    (void)state;
    fathom_config c = config;
    alignment a = good();
    a.overlap = a.pairs = 768;
    assert_int_equal(judge_alignment(&c, &a, 1), FATHOM_VERDICT_TRACKING);
    a.pairs = 767;
    assert_int_equal(judge_alignment(&c, &a, 1), FATHOM_VERDICT_FEW_PAIRS);
    c.min_pairs = 767;
    assert_int_equal(judge_alignment(&c, &a, 1), FATHOM_VERDICT_TRACKING);
    assert_int_equal(minimum_pairs(&config, 300), 6); /* never fewer than unknowns */
}

static void a_small_share_of_the_overlap_in_pairs_is_rejected(void **state) {
    (void)state;
    alignment a = good();
    a.pairs = (int)ceil((double)config.min_overlap * a.overlap);
    assert_int_equal(judge_alignment(&config, &a, 1), FATHOM_VERDICT_TRACKING);
    a.pairs -= 2;
    assert_int_equal(judge_alignment(&config, &a, 1), FATHOM_VERDICT_OVERLAP);
}

static void a_residual_that_is_large_or_none_is_rejected(void **state) {
    (void)state;
    alignment a = good();
    a.rms = (double)config.max_rms_m * 1.001;
    assert_int_equal(judge_alignment(&config, &a, 1), FATHOM_VERDICT_RESIDUAL);
    a.rms = NAN;
    assert_int_equal(judge_alignment(&config, &a, 1), FATHOM_VERDICT_RESIDUAL);
}

static void the_condition_counts_only_where_the_prior_does_not(void **state) {
    (void)state;
    fathom_config c = config;
    alignment a = good();
    a.condition = 1.001 * (double)c.max_condition;
    c.prior = FATHOM_PRIOR_INFORMATION;
    assert_int_equal(judge_alignment(&c, &a, 1), FATHOM_VERDICT_TRACKING);
    c.prior = FATHOM_PRIOR_SEED;
    assert_int_equal(judge_alignment(&c, &a, 1), FATHOM_VERDICT_CONDITION);
    a.condition = 0.999 * (double)c.max_condition;
    assert_int_equal(judge_alignment(&c, &a, 1), FATHOM_VERDICT_TRACKING);
}

static void an_innovation_beyond_its_sigmas_is_rejected(void **state) {
    (void)state;
    alignment a = good();
    assert_int_equal(judge_alignment(&config, &a, (double)config.max_innovation_sigmas), FATHOM_VERDICT_TRACKING);
    assert_int_equal(judge_alignment(&config, &a, 1.001 * (double)config.max_innovation_sigmas),
                     FATHOM_VERDICT_INNOVATION);
    assert_int_equal(judge_alignment(&config, &a, INFINITY), FATHOM_VERDICT_INNOVATION);
}

static void a_view_that_disagrees_or_is_seen_through_contradicts(void **state) {
    (void)state;
    comparison k = {.visible = 1000, .agree = 1000 * config.min_agreement, .through = 1000 * config.max_see_through};
    assert_int_equal(judge_view(&config, &k), FATHOM_VERDICT_TRACKING);
    assert_int_equal(judge_view(&config, &(comparison){0}), FATHOM_VERDICT_TRACKING); /* nothing that contradicts */
    k.agree -= 1;
    assert_int_equal(judge_view(&config, &k), FATHOM_VERDICT_CONTRADICTION);
    k.agree += 1;
    k.through += 1;
    assert_int_equal(judge_view(&config, &k), FATHOM_VERDICT_CONTRADICTION);
}

static void each_sigma_of_the_pose_alone_makes_it_uncertain(void **state) {
    (void)state;
    for (int i = 0; i < 6; i++) {
        alignment a = good();
        double most = i < 3 ? (double)config.max_sigma_rad : (double)config.max_sigma_m;
        a.covariance[7 * i] = 0.99 * most * most;
        assert_int_equal(judge_certainty(&config, a.covariance), FATHOM_VERDICT_TRACKING);
        a.covariance[7 * i] = 1.01 * most * most;
        assert_int_equal(judge_certainty(&config, a.covariance), FATHOM_VERDICT_UNCERTAIN);
        a.covariance[7 * i] = NAN;
        assert_int_equal(judge_certainty(&config, a.covariance), FATHOM_VERDICT_UNCERTAIN);
    }
}

/* What inertia knows of the motion since, and what the pairs know, add up. */
static void each_sigma_of_the_motion_since_an_earlier_pose_counts(void **state) {
    (void)state;
    for (int i = 0; i < 6; i++) {
        alignment a = good();
        double since[36] = {0};
        const double most = i < 3 ? (double)config.max_sigma_rad : (double)config.max_sigma_m;
        for (int k = 0; k < 6; k++) since[7 * k] = k == i ? 0.99 * most * most : 100;
        for (int k = 0; k < 6; k++) a.information[7 * k] = k == i ? 0 : 1e6;
        assert_int_equal(judge_certainty_since(&config, since, &a), FATHOM_VERDICT_TRACKING);
        since[7 * i] = 1.03 * most * most;
        assert_int_equal(judge_certainty_since(&config, since, &a), FATHOM_VERDICT_UNCERTAIN);
        a.information[7 * i] = 0.1 / (most * most); /* the pairs know the rest */
        assert_int_equal(judge_certainty_since(&config, since, &a), FATHOM_VERDICT_TRACKING);
        a.information[i < 3 ? 35 : 0] = 0; /* another direction isn't known */
        assert_int_equal(judge_certainty_since(&config, since, &a), FATHOM_VERDICT_UNCERTAIN);
        since[7 * i] = 0; /* nothing is known */
        assert_int_equal(judge_certainty_since(&config, since, &a), FATHOM_VERDICT_UNCERTAIN);
    }
}

/* A seed that claims to be exact, and a result as far off as the floors: a sigma in each direction. */
static void the_innovation_has_floors(void **state) {
    (void)state;
    for (int i = 0; i < 6; i++) {
        align_prior prior = {.mean = pose_identity()};
        attempt a = {.icp = good()};
        double twist[6] = {0}, floor = i < 3 ? (double)config.seed_noise_rad : (double)config.seed_noise_m;
        for (int k = 0; k < 6; k++) prior.covariance[7 * k] = 1e-18;
        twist[i] = floor;
        a.icp.motion = pose_exp(twist);
        measure_innovation(&config, &prior, &a);
        assert_true(fabs(a.innovation - 1) < 1e-5);
        prior.covariance[7 * i] = 3 * floor * floor; /* both count */
        measure_innovation(&config, &prior, &a);
        assert_true(fabs(a.innovation - 0.5) < 1e-5);
    }
}

/* The prior's errors live in the axes of the camera at its mean. */
static void the_innovation_is_measured_from_the_priors_mean_in_its_axes(void **state) {
    (void)state;
    const double at[6] = {0.3, -1.1, 0.5, 1, 2, 3}, off[6] = {0, 0, 0, 0.3, 0, 0};
    align_prior prior = {.mean = pose_exp(at)};
    attempt a = {.icp = good()};
    for (int k = 0; k < 6; k++) prior.covariance[7 * k] = k == 3 ? 0.01 : 1e-8;
    pose way = pose_exp(off);
    a.icp.motion = pose_multiply(&prior.mean, &way);
    measure_innovation(&config, &prior, &a);
    double floor = (double)config.seed_noise_m;
    assert_true(fabs(a.innovation - 0.3 / sqrt(0.01 + floor * floor)) < 1e-6);
    assert_true(fabs(a.translation_m - 0.3) < 1e-9 && fabs(a.rotation_rad) < 1e-7);
}

static void evident_needs_a_good_seed_many_pairs_and_nearness(void **state) {
    (void)state;
    attempt a = {.icp = good(), .seeded = true, .innovation = 0.99 * (double)config.max_evident_sigmas};
    double valid = 0.5; /* of the frame */
    a.icp.pairs = (int)ceil((double)config.min_evident_fraction * valid * a.icp.pixels);
    assert_true(evident(&config, valid, &a));
    a.icp.pairs -= 2;
    assert_false(evident(&config, valid, &a));
    a.icp.pairs += 2;
    a.seeded = false;
    assert_false(evident(&config, valid, &a));
    a.seeded = true;
    a.innovation = 1.01 * (double)config.max_evident_sigmas;
    assert_false(evident(&config, valid, &a));
}

static void an_ill_conditioned_pose_is_not_settled_by_geometry(void **state) {
    (void)state;
    attempt a = {.icp = good(), .verdict = FATHOM_VERDICT_TRACKING};
    a.icp.condition = 0.49 * (double)config.max_condition;
    assert_true(settled_by_geometry(&config, &a));
    a.verdict = FATHOM_VERDICT_INNOVATION; /* only inertia says otherwise */
    assert_true(settled_by_geometry(&config, &a));
    a.icp.condition = 0.51 * (double)config.max_condition;
    assert_false(settled_by_geometry(&config, &a));
    a.icp.condition = 5;
    a.verdict = FATHOM_VERDICT_RESIDUAL;
    assert_false(settled_by_geometry(&config, &a));
}

static void what_fits_worse_is_not_taken(void **state) {
    (void)state;
    attempt a = {.icp = good(), .verdict = FATHOM_VERDICT_TRACKING}, other = a;
    assert_false(fits_better(&config, &other, &a)); /* as well */
    other.icp.rms = 1.2 * a.icp.rms;
    assert_false(fits_better(&config, &other, &a));
    other.icp.rms = 0.7 * a.icp.rms;
    assert_true(fits_better(&config, &other, &a));
    other.icp.pairs = 20000; /* a few pairs that fit better, and many that are far */
    assert_false(fits_better(&config, &other, &a));
    other = a;
    other.icp.pairs = 59000;
    assert_true(fits_better(&config, &other, &a));
    other.verdict = FATHOM_VERDICT_CONTRADICTION;
    assert_false(fits_better(&config, &other, &a));
    other.verdict = FATHOM_VERDICT_TRACKING;
    other.icp.rms = 0.009;
    a.verdict = FATHOM_VERDICT_RESIDUAL; /* then what may be trusted is taken as it is */
    assert_true(fits_better(&config, &other, &a));
}

static void what_more_tries_cannot_mend_is_not_tried_again(void **state) {
    (void)state;
    for (int v = 0; v <= FATHOM_VERDICT_UNCERTAIN; v++) {
        bool hopeless =
            v == FATHOM_VERDICT_TRACKING || v == FATHOM_VERDICT_NO_DEPTH || v == FATHOM_VERDICT_UNCERTAIN;
        assert_int_equal(worth_another_try((fathom_verdict)v), !hopeless);
    }
}

static void a_pose_that_is_not_near_its_seed_is_doubted(void **state) {
    (void)state;
    attempt a = {.icp = good(), .verdict = FATHOM_VERDICT_TRACKING, .agreement = 0.9, .innovation = 0.49};
    assert_true(undoubted(&config, &a));
    a.innovation = 0.51;
    assert_false(undoubted(&config, &a));
    a.agreement = NAN; /* evident: the view wasn't even looked at */
    assert_true(undoubted(&config, &a));
    a.verdict = FATHOM_VERDICT_OVERLAP;
    assert_false(undoubted(&config, &a));
}

#define WIDTH 64
#define HEIGHT 48

static double part(depth_maps *maps, uint16_t left, uint16_t right) {
    static uint16_t depth[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++) depth[i] = i % WIDTH < WIDTH / 2 ? left : right;
    fathom_depth_frame scan = FATHOM_STRUCT(fathom_depth_frame);
    scan.depth = depth;
    scan.width = WIDTH;
    scan.height = HEIGHT;
    scan.row_stride_bytes = 2 * WIDTH;
    return valid_part(maps, &scan);
}

/* At voxels of 5 mm the default noise lets depth count up to 3.6 m, whatever max_depth_m says. */
static void depth_that_noise_rules_out_is_not_valid(void **state) {
    (void)state;
    depth_maps maps;
    device none = {0};
    arena count = {NULL, 0, 0};
    fathom_config c = config;
    c.depth_camera.width = WIDTH;
    c.depth_camera.height = HEIGHT;
    c.voxel_m = 0.005f;
    none.config = &c;
    depth_maps_init(&maps, &none, &count, &c);
    assert_true(part(&maps, 2000, 2000) == 1);
    assert_true(part(&maps, 2000, 4500) == 0.5);
    assert_true(part(&maps, 0, 65535) == 0);
    assert_true(part(&maps, 299, 301) == 0.5); /* min_depth_m */
    c.voxel_m = 0.02f;
    depth_maps_init(&maps, &none, &count, &c);
    assert_true(part(&maps, 2000, 4500) == 1);
    assert_true(part(&maps, 2000, 5001) == 0.5); /* max_depth_m */
    assert_false(has_depth(0.0099));
    assert_true(has_depth(0.01));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_good_alignment_is_tracking),
        cmocka_unit_test(one_pair_in_a_hundred_pixels_is_needed),
        cmocka_unit_test(a_small_share_of_the_overlap_in_pairs_is_rejected),
        cmocka_unit_test(a_residual_that_is_large_or_none_is_rejected),
        cmocka_unit_test(the_condition_counts_only_where_the_prior_does_not),
        cmocka_unit_test(an_innovation_beyond_its_sigmas_is_rejected),
        cmocka_unit_test(a_view_that_disagrees_or_is_seen_through_contradicts),
        cmocka_unit_test(each_sigma_of_the_pose_alone_makes_it_uncertain),
        cmocka_unit_test(each_sigma_of_the_motion_since_an_earlier_pose_counts),
        cmocka_unit_test(the_innovation_has_floors),
        cmocka_unit_test(the_innovation_is_measured_from_the_priors_mean_in_its_axes),
        cmocka_unit_test(evident_needs_a_good_seed_many_pairs_and_nearness),
        cmocka_unit_test(an_ill_conditioned_pose_is_not_settled_by_geometry),
        cmocka_unit_test(what_fits_worse_is_not_taken),
        cmocka_unit_test(what_more_tries_cannot_mend_is_not_tried_again),
        cmocka_unit_test(a_pose_that_is_not_near_its_seed_is_doubted),
        cmocka_unit_test(depth_that_noise_rules_out_is_not_valid),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
