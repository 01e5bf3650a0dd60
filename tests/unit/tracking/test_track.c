/* Attempts to align a frame, each from a start of its own, and one prior (lib/tracking/track.c), on the library's insides: a
 * desk is scanned, then one of its frames is aligned from seeds that are given. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/covariance.h"
#include "context.h"
#include "synthetic.h"
#include "tracking/relocalise.h"

#define KNOWN 12

static synthetic_frame desk[KNOWN], wall;
static synthetic_context s;
static fathom *f;

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_DESK, 0, KNOWN, desk);
    wall = desk[0];
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) wall.depth[i] = (uint16_t)(1.5 * SYNTHETIC_UNITS);
    return 0;
}

static fathom_config without_imu(void) {
    fathom_config c = synthetic_config(&desk[0]);
    c.imu = false;
    return c;
}

static void scan_desk(const fathom_config *c) {
    s = synthetic_start(c);
    f = s.scan;
    for (int i = 0; i < KNOWN; i++) assert_true(synthetic_step(f, &desk[i]).fused);
}

/* The wall from the first pose, until its surface is smooth. */
static void scan_wall(const fathom_config *c) {
    s = synthetic_start(c);
    f = s.scan;
    for (int i = 0; i < 5; i++) {
        fathom_result r = FATHOM_STRUCT(fathom_result);
        depth_maps_make(&f->maps, &f->device, wall.depth, 2 * SYNTHETIC_WIDTH, 0);
        fuse(&f->fusing, &f->pose, &r);
    }
}

static fathom_depth_frame scan_of(const synthetic_frame *frame) {
    fathom_depth_frame scan = FATHOM_STRUCT(fathom_depth_frame);
    scan.timestamp_ns = frame->timestamp_ns;
    scan.depth = frame->depth;
    scan.width = SYNTHETIC_WIDTH;
    scan.height = SYNTHETIC_HEIGHT;
    scan.row_stride_bytes = 2 * SYNTHETIC_WIDTH;
    return scan;
}

static bool align_frame(const synthetic_frame *frame, const align_prior *seed, attempt *icp) {
    fathom_depth_frame scan = scan_of(frame);
    depth_maps_make(&f->maps, &f->device, frame->depth, 2 * SYNTHETIC_WIDTH, 0);
    device_wait(&f->device);
    return track(&f->tracker, &scan, seed, icp);
}

static align_prior prior_of(const pose *at, const double off[6], double sigma_rad, double sigma_m) {
    pose by = pose_exp(off);
    align_prior p = {.mean = pose_multiply(at, &by)};
    for (int i = 0; i < 6; i++) p.covariance[7 * i] = i < 3 ? sigma_rad * sigma_rad : sigma_m * sigma_m;
    return p;
}

static pose truth_of(const synthetic_frame *frame) {
    pose p;
    assert_true(pose_take(&frame->pose, &p));
    return p;
}

/* Eight decimetres and 33 degrees off, where only the search finds the way back. */
static const double far_off[6] = {0.25, -0.45, 0.25, 0.6, -0.35, 0.4};

static void what_the_search_finds_is_held_against_the_seed(void **state) {
    (void)state;
    fathom_config c = without_imu();
    scan_desk(&c);
    pose truth = truth_of(&desk[KNOWN - 1]);
    align_prior seed = prior_of(&truth, far_off, 0.25, 0.35);
    attempt icp;
    assert_true(align_frame(&desk[KNOWN - 1], &seed, &icp));
    assert_true(icp.searched);
    pose left = pose_between(&truth, &icp.icp.motion), way = pose_between(&seed.mean, &icp.icp.motion);
    assert_true(pose_distance(&left) < 0.01);
    assert_true(fabs(icp.translation_m - pose_distance(&way)) < 1e-9);
    assert_true(fabs(icp.rotation_rad - pose_angle(&way)) < 1e-9);
    double twist[6], sum = 0;
    pose_log(&way, twist);
    for (int i = 0; i < 6; i++) sum += twist[i] * twist[i] / seed.covariance[7 * i];
    assert_true(fabs(icp.innovation / sqrt(sum) - 1) < 0.01); /* the floors hardly count here */
    synthetic_stop(&s);
}

/* The same place, and a seed so sure of itself that it can't be right. */
static void what_the_search_finds_beyond_the_seeds_sigmas_is_rejected(void **state) {
    (void)state;
    fathom_config c = without_imu();
    c.max_innovation_sigmas = 1.5f;
    scan_desk(&c);
    pose truth = truth_of(&desk[KNOWN - 1]);
    align_prior seed = prior_of(&truth, far_off, 0.25, 0.35);
    attempt icp;
    assert_false(align_frame(&desk[KNOWN - 1], &seed, &icp));
    assert_true(icp.searched);
    synthetic_stop(&s);
}

/* Inertia is sure of a wrong place, and isn't known to be right: where the last velocity leads the frame is found, and what is
 * reported is the way from there. */
static void what_the_last_velocity_finds_is_held_against_where_it_led(void **state) {
    (void)state;
    enum { SAMPLES = 200 };
    static fathom_imu_sample samples[SAMPLES];
    fathom_config c = synthetic_config(&desk[0]);
    s = synthetic_start(&c);
    f = s.scan;
    int count = synthetic_imu(SCENE_DESK, 0, KNOWN, "consumer", 200, SAMPLES, samples), next = 0;
    for (int i = 0; i < KNOWN; i++) {
        for (; next < count && samples[next].timestamp_ns <= desk[i].timestamp_ns; next++)
            fathom_push_imu(f, &samples[next]);
        if (i < KNOWN - 1) assert_true(synthetic_step(f, &desk[i]).fused);
    }
    const double off[6] = {0, 0.1, 0, 0.3, 0, 0};
    pose truth = truth_of(&desk[KNOWN - 1]);
    align_prior seed = prior_of(&truth, off, 0.005, 0.005);
    attempt icp;
    assert_true(align_frame(&desk[KNOWN - 1], &seed, &icp));
    assert_true(icp.by_velocity && !icp.searched);
    assert_true(icp.translation_m < 0.03 && icp.rotation_rad < 0.03 && icp.innovation < 3);
    synthetic_stop(&s);
}

/* A wall tells its distance and tilt; the rest is inertia's, wherever alignment began. */
static void what_a_wall_leaves_free_is_held_by_the_prior_and_not_by_the_start(void **state) {
    (void)state;
    fathom_config c = without_imu();
    scan_wall(&c);
    const double believed[6] = {0, 0, 0.02, 0.03, -0.02, 0.01},
                 drawn[6] = {0.03, -0.02, -0.05, -0.1, 0.12, 0.03};
    pose here = f->pose, by = pose_exp(drawn), start = pose_multiply(&here, &by);
    align_prior prior = prior_of(&here, believed, 0.05, 0.05);
    attempt icp;
    align_frame(&wall, &prior, &icp); /* the frame is in the maps */
    track_attempt(&f->tracker, &start, &prior, false, &icp);
    double off[6];
    pose left = pose_between(&here, &icp.icp.motion);
    pose_log(&left, off);
    for (int i = 0; i < 6; i++) {
        bool free_one = i >= 2 && i <= 4;
        double want = free_one ? believed[i] : 0, tolerance = free_one ? 0.006 : 0.002;
        if (fabs(off[i] - want) >= tolerance) print_message("%d: %.4f, not %.4f\n", i, off[i], want);
        assert_true(fabs(off[i] - want) < tolerance);
    }
    synthetic_stop(&s);
}

/* Three sigmas off the prior: the few iterations of a seeded frame don't suffice, and go on while they move the pose. */
static void iterations_go_on_until_the_pose_has_settled(void **state) {
    (void)state;
    fathom_config c = without_imu();
    const int two[FATHOM_LEVELS] = {0, 0, 2};
    memcpy(c.max_seeded_iterations, two, sizeof two);
    scan_desk(&c);
    const double off[6] = {0, 0, 0.05, 0.02, 0.02, 0}, near[6] = {0, 0, 0.001, 0, 0, 0};
    const pose truth = truth_of(&desk[KNOWN - 1]);
    attempt far_start, near_start;
    align_prior seed = prior_of(&truth, off, 0.015, 0.01);
    f->tracker.cost.iterations = 0; /* those of the frames before */
    track_attempt(&f->tracker, &seed.mean, &seed, true, &far_start);
    const int many = f->tracker.cost.iterations;
    const pose left = pose_between(&truth, &far_start.icp.motion);
    if (pose_distance(&left) > 0.003 || pose_angle(&left) > 0.003)
        print_message("%g m, %g rad after %d\n", pose_distance(&left), pose_angle(&left), many);
    assert_true(many > 2 && many <= 8);
    assert_true(pose_distance(&left) < 0.003 && pose_angle(&left) < 0.003);
    seed = prior_of(&truth, near, 0.015, 0.01);
    track_attempt(&f->tracker, &seed.mean, &seed, true, &near_start);
    assert_true(f->tracker.cost.iterations - many <= 2);
    synthetic_stop(&s);
}

/* A seed that is sure of a wrong place: first by max_seeded_iterations, then by all. */
static void a_failed_attempt_costs_too(void **state) {
    (void)state;
    fathom_config c = without_imu();
    c.min_update_rad = c.min_update_m = 0;
    c.min_error_decrease = -1e9f; /* every iteration is spent */
    const int seeded[FATHOM_LEVELS] = {0, 0, 4}, all[FATHOM_LEVELS] = {1, 1, 1};
    memcpy(c.max_seeded_iterations, seeded, sizeof seeded);
    memcpy(c.max_iterations, all, sizeof all);
    scan_desk(&c);
    const double off[6] = {0, 0, 0, 0.12, 0, 0};
    pose truth = truth_of(&desk[KNOWN - 1]);
    align_prior seed = prior_of(&truth, off, 0.001, 0.002);
    attempt icp;
    assert_false(align_frame(&desk[KNOWN - 1], &seed, &icp));
    assert_false(icp.seeded || icp.searched);
    int spent = f->tracker.cost.iterations;
    assert_true(spent == 4 + 3 ||
                spent == 4 + 3 + 3); /* perhaps with a second round from where the first has led */
    assert_true(f->tracker.cost.ms_align > 0 && f->tracker.cost.ms_raycast > 0);
    synthetic_stop(&s);
}

static void maps_serve_again_until_the_camera_has_moved_or_turned(void **state) {
    (void)state;
    fathom_config c = without_imu();
    model_maps maps = {.config = &c};
    const double at[6] = {0.2, 0.5, -0.3, 1, 2, 3};
    maps.seen_from = pose_exp(at);
    model_maps_renew(&maps, &maps.seen_from, FINEST);
    for (int i = 0; i < 6; i++)
        for (int far = 0; far < 2; far++) {
            double twist[6] = {0};
            twist[i] = (far ? 1.01 : 0.99) * (double)(i < 3 ? c.max_model_reuse_rad : c.max_model_reuse_m);
            pose by = pose_exp(twist), there = pose_multiply(&maps.seen_from, &by);
            assert_int_equal(model_maps_hold(&maps, &there, FINEST), !far);
        }
    assert_false(model_maps_hold(&maps, &maps.seen_from, 0)); /* coarser levels weren't cast */
    model_maps_used(&maps, 1000, 1);
    assert_true(model_maps_hold(&maps, &maps.seen_from, FINEST));
    model_maps_used(&maps, 901, 1);
    assert_true(model_maps_hold(&maps, &maps.seen_from, FINEST));
    model_maps_used(&maps, 899, 1); /* of the 1000 that they had when they were new */
    assert_false(model_maps_hold(&maps, &maps.seen_from, FINEST));
    model_maps_renew(&maps, &maps.seen_from, FINEST);
    model_maps_used(&maps, 1000, 0.51 * (double)c.max_condition);
    assert_false(model_maps_hold(&maps, &maps.seen_from, FINEST));
}

static void a_reset_forgets_the_maps_of_the_old_world(void **state) {
    (void)state;
    fathom_config c = without_imu();
    scan_desk(&c);
    assert_true(f->tracker.models.coarsest <= FINEST);
    assert_int_equal(fathom_reset(f), FATHOM_OK);
    assert_int_equal(f->tracker.models.coarsest, FATHOM_LEVELS);
    pose at = f->tracker.models.seen_from;
    assert_false(model_maps_hold(&f->tracker.models, &at, FINEST));
    synthetic_stop(&s);
}

/* The places that the search proposes: from the right one itself, and from seeds off by half a metre and 15 degrees, the first
 * lies where alignment finds the way alone; and no two are the same. */
static void the_search_proposes_the_right_place_first(void **state) {
    (void)state;
    static const double off[][6] = {{0},
                                    {0.02, 0.1, 0, 0.1, 0, -0.1},
                                    {0, -0.25, 0.05, 0.3, 0.1, 0},
                                    {-0.15, 0.1, -0.1, -0.3, 0.2, -0.2}};
    fathom_config c = without_imu();
    scan_desk(&c);
    const pose truth = truth_of(&desk[KNOWN - 1]);
    depth_maps_make(&f->maps, &f->device, desk[KNOWN - 1].depth, 2 * SYNTHETIC_WIDTH, 0);
    for (int i = 0; i < 4; i++) {
        const align_prior seed = prior_of(&truth, off[i], 0.12, 0.2);
        pose best[SEARCH_BEST];
        unsigned drawn = 0;
        const int found = search_about(&f->tracker.aligner, &f->device, &f->maps, &f->tracker.view,
                                       &f->raycaster, &seed.mean, seed.covariance, &drawn, best);
        assert_true(found > 0 && found <= SEARCH_BEST);
        assert_int_equal(drawn, 128);
        pose rest = pose_between(&best[0], &truth);
        print_message("# seed %d: %d places, the first off by %.3f rad, %.3f m\n", i, found,
                      pose_angle(&rest), pose_distance(&rest));
        assert_true(pose_angle(&rest) < 0.03 && pose_distance(&rest) < 0.05);
    }
    synthetic_stop(&s);
}

static void assert_no_figures(const fathom_result *r) {
    assert_int_equal(r->verdict, FATHOM_VERDICT_NO_DEPTH);
    assert_true(r->pairs == 0 && r->iterations == 0 && r->rms_m == 0 && r->weight == 0);
    assert_true(r->prior_rotation_rad == 0 && r->prior_translation_m == 0 && r->innovation_sigmas == 0);
    assert_false(r->fused || r->searched || r->by_velocity);
}

static void a_frame_that_shows_nothing_has_no_figures(void **state) {
    (void)state;
    fathom_config c = without_imu();
    scan_desk(&c);
    fathom_result r = synthetic_blank(f, desk[KNOWN - 1].timestamp_ns + SYNTHETIC_PERIOD_NS);
    assert_no_figures(&r);
    assert_int_equal(r.state, FATHOM_RECKONED);
    assert_true(isinf(r.condition) && isnan(r.agreement) && isnan(r.see_through));
    synthetic_stop(&s);
}

/* What is refused before the first frame, or the first after a reset, is answered with what is known: where it begins. */
static void before_the_first_frame_nothing_is_known_but_the_pose(void **state) {
    (void)state;
    fathom_config c = without_imu();
    c.first_pose.position[0] = 4;
    s = synthetic_start(&c);
    f = s.scan;
    for (int i = 0; i < 2; i++) {
        fathom_result r = FATHOM_STRUCT(fathom_result);
        assert_int_equal(fathom_step(f, NULL, &r), FATHOM_ERROR_ARGUMENT);
        assert_no_figures(&r);
        assert_int_equal(r.state, FATHOM_RECKONED);
        assert_true(synthetic_distance(r.pose, c.first_pose) < 1e-9 &&
                    synthetic_distance(r.odometry, c.first_pose) < 1e-9);
        assert_int_equal(synthetic_step(f, &desk[i]).state, FATHOM_FIRST);
        assert_int_equal(fathom_reset(f), FATHOM_OK);
    }
    synthetic_stop(&s);
}

/* Pixels in which the surface is seen, of all. */
static void the_part_of_a_view_that_shows_surface_is_counted(void **state) {
    (void)state;
    fathom_config c = without_imu();
    scan_desk(&c);
    model_view *w = &f->tracker.view;
    const pose at = truth_of(&desk[KNOWN - 1]);
    for (int turned = 0; turned < 4; turned++) {
        const double twist[6] = {0, turned < 3 ? 0.35 * turned : 3.1, 0};
        pose by = pose_exp(twist), from = pose_multiply(&at, &by);
        const double part = model_view_part(w, &f->device, &f->raycaster, &from);
        model_view_cast(w, &f->device, &f->raycaster, &from);
        cl_uint2 *map = device_map(&f->device, &w->map, CL_MAP_READ);
        const int pixels = w->same.width * w->same.height;
        int seen = 0;
        assert_non_null(map);
        for (int i = 0; i < pixels; i++) seen += kernel_point_of(map[i]).depth > 0;
        device_unmap(&f->device, &w->map, map);
        assert_true(fabs(part * pixels - seen) < 1e-6);
        assert_true(turned == 0 ? part > 0.85 : turned == 3 ? part < 0.01 : part > 0.1 && part < 0.85);
    }
    synthetic_stop(&s);
}

static void a_camera_that_turns_is_not_calm(void **state) {
    (void)state;
    volume v = {.pool = {.count = 1}};
    const double at[6] = {0.2, 0.5, -0.3, 1, 2, 3};
    fusing last = {.volume = &v, .last = pose_exp(at)};
    for (int i = 0; i < 6; i++)
        for (int far = 0; far < 2; far++) {
            double twist[6] = {0};
            twist[i] = (far ? 1.01 : 0.99) * (i < 3 ? 0.04 : 0.03);
            pose by = pose_exp(twist), there = pose_multiply(&last.last, &by);
            assert_int_equal(fusing_is_calm(&last, &there), !far);
        }
    v.pool.count = 0; /* the first frame goes in whole */
    assert_false(fusing_is_calm(&last, &last.last));
}

/* Metres on the finest maps; a pixel of a coarser one is twice as wide, and so is what may lie between the two of a pair. */
static void pairs_may_lie_further_apart_on_coarser_levels(void **state) {
    (void)state;
    fathom_config c = without_imu();
    aligner a = {.config = &c};
    for (int k = 0; k < 3; k++) {
        double sigma = k == 0 ? 0 : k == 1 ? 0.1 : 5;
        double finest = k == 0   ? (double)c.max_pair_distance_m
                        : k == 1 ? 0.3
                                 : 0.6; /* three sigma, of 0.2 at most */
        for (int level = 0; level < FATHOM_LEVELS; level++)
            assert_true(fabs((double)align_reach(&a, level, sigma) / finest - (1 << (FINEST - level))) <
                        1e-5);
    }
}

/* The covariance of the result, against what a fiftieth of the pairs would give. */
static void fifty_neighbouring_pairs_count_as_one(void **state) {
    (void)state;
    for (int prior = 0; prior < 2; prior++) {
        fathom_config c = without_imu();
        c.prior = prior ? FATHOM_PRIOR_INFORMATION : FATHOM_PRIOR_SEED;
        scan_desk(&c);
        const double none[6] = {0}, centre[3] = {0, 0, 1};
        pose truth = truth_of(&desk[KNOWN - 1]);
        align_prior seed = prior_of(&truth, none, 1, 1);
        attempt icp;
        align_frame(&desk[KNOWN - 1], &seed, &icp);
        model_maps *m = &f->tracker.models;
        pose motion = pose_between(&m->seen_from, &icp.icp.motion);
        normal_equations e;
        solution alone;
        double independent[36], variance;
        align_reduce(&f->tracker.aligner, &f->device, &f->maps, FINEST, &motion, &m->level[FINEST],
                     &f->maps.camera[FINEST], 0.6, (double)c.huber_m, centre, &e);
        const solve_prior fifty = {.information = {0},
                                   .correlated = 50,
                                   .shared_m = f->tracker.aligner.shared_m};
        assert_true(solve_alignment(&e, prior ? &fifty : NULL, &alone));
        covariance_to_scan(&motion, alone.covariance, independent);
        variance = prior ? 1 : alone.residual / (e.pairs - 6) * 50;
        for (int i = 0; i < 6; i++) {
            double ratio = icp.icp.covariance[7 * i] / (independent[7 * i] * variance);
            if (!(ratio > 0.8 && ratio < 1.2)) print_message("prior %d, direction %d: %g\n", prior, i, ratio);
            assert_true(ratio > 0.8 && ratio < 1.2);
        }
        synthetic_stop(&s);
    }
}

/* A wall seen aslant, from 3 cm too far: along the ray that is 9 cm and more, across the wall 3. */
static void a_slanted_surface_is_compared_across_itself(void **state) {
    (void)state;
    static synthetic_frame slanted;
    fathom_config c = without_imu();
    c.depth_noise_growth_per_m = 0.001f;
    const fathom_pinhole *camera = &c.depth_camera;
    const kernel_camera k = kernel_camera_of(SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT, (float)camera->fx,
                                             (float)camera->fy, (float)camera->cx, (float)camera->cy);
    const double normal[3] = {sin(1.2), 0, -cos(1.2)};
    slanted = desk[0];
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) {
        double x = (i % SYNTHETIC_WIDTH - (double)k.cx) / (double)k.fx,
               z = -0.4 / (normal[0] * x + normal[2]);
        slanted.depth[i] = z > 0.4 && z < 3 ? (uint16_t)lround(z * SYNTHETIC_UNITS) : 0;
    }
    s = synthetic_start(&c);
    f = s.scan;
    for (int i = 0; i < 8; i++) {
        fathom_result r = FATHOM_STRUCT(fathom_result);
        depth_maps_make(&f->maps, &f->device, slanted.depth, 2 * SYNTHETIC_WIDTH, 0);
        fuse(&f->fusing, &f->pose, &r);
    }
    for (int far = 0; far < 2; far++) {
        comparison found;
        pose off = pose_identity();
        for (int i = 0; i < 3; i++) off.t[i] = (far ? 0.08 : 0.03) * normal[i];
        pose at = pose_multiply(&f->pose, &off);
        depth_maps_make(&f->maps, &f->device, slanted.depth, 2 * SYNTHETIC_WIDTH, 0);
        model_view_compare(&f->tracker.view, &f->device, &f->maps, &f->raycaster, &at, 0.04f, &found);
        print_message("%.2f m off: %.1f visible, %.1f agree, %.1f through\n", far ? 0.08 : 0.03,
                      (double)found.visible, (double)found.agree, (double)found.through);
        assert_true(found.visible > 50);
        assert_true(far ? found.agree < 0.2f * found.visible : found.agree > 0.9f * found.visible);
    }
    synthetic_stop(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_the_search_finds_is_held_against_the_seed),
        cmocka_unit_test(what_the_search_finds_beyond_the_seeds_sigmas_is_rejected),
        cmocka_unit_test(what_the_last_velocity_finds_is_held_against_where_it_led),
        cmocka_unit_test(what_a_wall_leaves_free_is_held_by_the_prior_and_not_by_the_start),
        cmocka_unit_test(iterations_go_on_until_the_pose_has_settled),
        cmocka_unit_test(a_failed_attempt_costs_too),
        cmocka_unit_test(maps_serve_again_until_the_camera_has_moved_or_turned),
        cmocka_unit_test(a_reset_forgets_the_maps_of_the_old_world),
        cmocka_unit_test(the_search_proposes_the_right_place_first),
        cmocka_unit_test(a_frame_that_shows_nothing_has_no_figures),
        cmocka_unit_test(before_the_first_frame_nothing_is_known_but_the_pose),
        cmocka_unit_test(the_part_of_a_view_that_shows_surface_is_counted),
        cmocka_unit_test(a_camera_that_turns_is_not_calm),
        cmocka_unit_test(pairs_may_lie_further_apart_on_coarser_levels),
        cmocka_unit_test(fifty_neighbouring_pairs_count_as_one),
        cmocka_unit_test(a_slanted_surface_is_compared_across_itself),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
