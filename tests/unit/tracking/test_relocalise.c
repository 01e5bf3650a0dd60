/* Places that relocalisation proposes about the seed (lib/tracking/relocalise.c). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "tracking/relocalise.h"

#define DRAWS 20000

static void covariance_of_draws(const double spread[36], double c[36]) {
    memset(c, 0, 36 * sizeof *c);
    for (int t = 0; t < DRAWS; t++) {
        double twist[6];
        search_draw(spread, 1, (unsigned)t + 1, twist);
        for (int i = 0; i < 36; i++) c[i] += twist[i / 6] * twist[i % 6] / DRAWS;
    }
}

static void the_seed_itself_is_tried_first(void **state) {
    (void)state;
    double covariance[36] = {0}, spread[36], twist[6];
    for (int i = 0; i < 6; i++) covariance[7 * i] = 0.01;
    search_spread(covariance, spread);
    for (unsigned drawn = 0; drawn < 300; drawn++) {
        search_draw(spread, 0, drawn, twist);
        for (int i = 0; i < 6; i++) assert_true(twist[i] == 0);
        search_draw(spread, 1, drawn + 1, twist);
        assert_true(twist[0] != 0 && twist[5] != 0);
    }
}

static void draws_have_the_seeds_covariance(void **state) {
    (void)state;
    double covariance[36] = {0}, spread[36], found[36];
    for (int i = 0; i < 6; i++) covariance[7 * i] = 0.01 * (i + 1);
    covariance[3] = covariance[18] = 0.012; /* a turn and a way that go together, as on a lever arm */
    covariance[29] = covariance[34] = -0.02;
    search_spread(covariance, spread);
    covariance_of_draws(spread, found);
    for (int i = 0; i < 36; i++)
        assert_true(fabs(found[i] - covariance[i]) < 0.03 * sqrt(covariance[7 * (i / 6)] * covariance[7 * (i % 6)]));
}

static void a_seed_that_knows_nothing_is_looked_for_near_where_it_is(void **state) {
    (void)state;
    double covariance[36] = {0}, spread[36], found[36];
    for (int i = 0; i < 6; i++) covariance[7 * i] = i < 3 ? 4 : 100;
    search_spread(covariance, spread);
    covariance_of_draws(spread, found);
    for (int i = 0; i < 6; i++) { /* all of it shrinks alike */
        double sigma = i < 3 ? 0.14 : 0.7;
        assert_true(fabs(sqrt(found[7 * i]) - sigma) < 0.02 * sigma);
    }
}

static void other_frames_draw_other_places(void **state) {
    (void)state;
    double covariance[36] = {0}, spread[36], a[6], b[6];
    for (int i = 0; i < 6; i++) covariance[7 * i] = 0.01;
    search_spread(covariance, spread);
    search_draw(spread, 1, 1, a);
    search_draw(spread, 1, 129, b);
    for (int i = 0; i < 6; i++) assert_true(a[i] != b[i]);
}

static hypothesis at(double rad, double m, double score) {
    const double twist[6] = {0, rad, 0, 0, 0, m};
    return (hypothesis){pose_exp(twist), score};
}

static int keep_all(hypothesis *kept, int room, const hypothesis *all, int count) {
    int n = 0;
    for (int i = 0; i < count; i++)
        if (n < room || all[i].score > kept[n - 1].score) n = search_keep(kept, n, room, &all[i]);
    return n;
}

static void the_best_are_kept_best_first(void **state) {
    (void)state;
    hypothesis kept[4], all[8];
    static const double scores[8] = {3, 1, 7, 2, 8, 5, 4, 6};
    for (int i = 0; i < 8; i++) all[i] = at(0, i, scores[i]);
    assert_int_equal(keep_all(kept, 4, all, 8), 4);
    for (int i = 0; i < 4; i++) assert_true(kept[i].score == 8 - i);
}

static void of_two_that_are_the_same_the_better_one_is_kept(void **state) {
    (void)state;
    hypothesis kept[4];
    const hypothesis better[] = {at(0, 0, 1), at(0.02, 0.02, 2)}, worse[] = {at(0, 0, 2), at(0.02, 0.02, 1)};
    assert_int_equal(keep_all(kept, 4, better, 2), 1);
    assert_true(kept[0].score == 2);
    assert_int_equal(keep_all(kept, 4, worse, 2), 1);
    assert_true(kept[0].score == 2);
    const hypothesis turned[] = {at(0, 0, 1), at(0.06, 0, 2)}, moved[] = {at(0, 0, 1), at(0, 0.06, 2)};
    assert_int_equal(keep_all(kept, 4, turned, 2), 2); /* either is enough to be another place */
    assert_int_equal(keep_all(kept, 4, moved, 2), 2);
    const hypothesis among[] = {at(0, 0, 9), at(0, 1, 5), at(0, 2, 4), at(0, 1.01, 7)};
    assert_int_equal(keep_all(kept, 4, among, 4), 3);
    assert_true(kept[0].score == 9 && kept[1].score == 7 && kept[2].score == 4);
}

static void directions_without_room_are_left_alone(void **state) {
    (void)state;
    double covariance[36] = {0}, spread[36], twist[6];
    covariance[0] = covariance[35] = 0.01;
    search_spread(covariance, spread);
    for (unsigned i = 1; i < 100; i++) {
        search_draw(spread, 1, i, twist);
        for (int k = 1; k < 5; k++) assert_true(twist[k] == 0);
        assert_true(isfinite(twist[0]) && isfinite(twist[5]) && twist[0] != 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_seed_itself_is_tried_first),
        cmocka_unit_test(draws_have_the_seeds_covariance),
        cmocka_unit_test(a_seed_that_knows_nothing_is_looked_for_near_where_it_is),
        cmocka_unit_test(other_frames_draw_other_places),
        cmocka_unit_test(the_best_are_kept_best_first),
        cmocka_unit_test(of_two_that_are_the_same_the_better_one_is_kept),
        cmocka_unit_test(directions_without_room_are_left_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
