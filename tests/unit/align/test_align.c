/* What alignment makes of its pairs' information (lib/align/align.c): less trust in it, and the error that pixels share. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "align/align.h"
#include "base/covariance.h"
#include "simulate/counter_random.h"

/* A prior, and an alignment at the optimum of that and of pairs whose own lies elsewhere. */
typedef struct {
    align_prior prior;
    alignment joint;
    double known[36], own[36]; /* the informations */
    double apart[6];           /* the twist from the prior's mean to the pairs' optimum */
} problem;

/* A positive definite matrix with every entry in it. */
static void some_matrix(uint64_t seed, double scale, double m[36]) {
    double a[36];
    for (int i = 0; i < 36; i++) a[i] = random_normal(random_key(seed, 1), (uint64_t)i);
    for (int i = 0; i < 36; i++) {
        m[i] = i % 7 == 0 ? scale : 0;
        for (int k = 0; k < 6; k++) m[i] += 0.2 * scale * a[i / 6 * 6 + k] * a[i % 6 * 6 + k];
    }
}

static void multiply(const double m[36], const double x[6], double out[6]) {
    memset(out, 0, 6 * sizeof *out);
    for (int i = 0; i < 36; i++) out[i / 6] += m[i] * x[i % 6];
}

/* The optimum of the prior and a part of the pairs' information: its twist from the prior's mean, its covariance. */
static void optimum(const problem *p, double trust, double twist[6], double covariance[36]) {
    double sum[36], right[6];
    for (int i = 0; i < 36; i++) sum[i] = p->known[i] + trust * p->own[i];
    assert_true(covariance_invert(sum, covariance));
    multiply(p->own, p->apart, right);
    for (int i = 0; i < 6; i++) right[i] *= trust;
    multiply(covariance, right, twist);
}

static problem make(uint64_t seed) {
    const double at[6] = {0.4, -0.7, 0.3, 1.2, -0.5, 2.1};
    problem p = {.prior.mean = pose_exp(at)};
    double twist[6], rest[6];
    some_matrix(seed, 1e-4, p.prior.covariance);
    some_matrix(seed + 100, 3e5, p.own);
    assert_true(covariance_invert(p.prior.covariance, p.known));
    for (int i = 0; i < 6; i++) p.apart[i] = 1e-4 * random_normal(random_key(seed, 2), (uint64_t)i);
    optimum(&p, 1, twist, p.joint.covariance);
    const pose way = pose_exp(twist);
    p.joint.motion = pose_multiply(&p.prior.mean, &way);
    memcpy(p.joint.information, p.own, sizeof p.own);
    for (int i = 0; i < 6; i++) rest[i] = p.apart[i] - twist[i];
    multiply(p.own, rest, p.joint.pull);
    return p;
}

static void less_trust_is_the_optimum_of_the_prior_and_less_information(void **state) {
    (void)state;
    static const double trusts[] = {1, 0.5, 0.1, 0.001, 0};
    for (uint64_t seed = 1; seed <= 20; seed++)
        for (size_t k = 0; k < sizeof trusts / sizeof *trusts; k++) {
            problem p = make(seed);
            double twist[6], covariance[36], rest[6], pull[6], got[6];
            optimum(&p, trusts[k], twist, covariance);
            align_trust_less(&p.joint, &p.prior, trusts[k]);
            const pose way = pose_between(&p.prior.mean, &p.joint.motion);
            pose_log(&way, got);
            for (int i = 0; i < 6; i++) rest[i] = p.apart[i] - twist[i];
            multiply(p.own, rest, pull);
            for (int i = 0; i < 6; i++) {
                assert_true(fabs(got[i] - twist[i]) < 1e-7);
                assert_true(fabs(p.joint.pull[i] - trusts[k] * pull[i]) < 0.05);
            }
            for (int i = 0; i < 36; i++) {
                assert_true(fabs(p.joint.covariance[i] - covariance[i]) < 1e-9);
                assert_true(p.joint.information[i] == trusts[k] * p.own[i]);
            }
        }
}

static void the_shared_error_is_followed(void **state) {
    (void)state;
    aligner a = {.shared_m = 0};
    const alignment nothing = {.shared_m = 0}, one = {.shared_m = 0.001}, four = {.shared_m = 0.004};
    aligner_learn(&a, &nothing);
    assert_true(a.shared_m == 0);
    aligner_learn(&a, &one);
    assert_true(a.shared_m == 0.001);
    aligner_learn(&a, &four); /* of two frames the geometric mean */
    assert_true(fabs(a.shared_m - 0.002) < 1e-9);
    for (int i = 0; i < 20; i++) aligner_learn(&a, &one);
    assert_true(a.shared_m > 0.001 && a.shared_m < 0.0012);
    const double before = a.shared_m;
    aligner_learn(&a, &four); /* later frames weigh a tenth */
    assert_true(fabs(a.shared_m / before - pow(0.004 / before, 0.1)) < 1e-9);
    aligner_reset(&a);
    assert_true(a.shared_m == 0);
    aligner_learn(&a, &four);
    assert_true(a.shared_m == 0.004);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(less_trust_is_the_optimum_of_the_prior_and_less_information),
        cmocka_unit_test(the_shared_error_is_followed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
