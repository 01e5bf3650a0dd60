/* Calibration of the rig (examples/cli/calibration.h) on simulated ways whose rig is known. The poses are the true ones
 * with noise, so no frame is rendered and no library runs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../examples/cli/calibration.h"
#include "../examples/cli/counter_random.h"
#include "../examples/cli/imu_model.h"

#define DEGREES 57.29577951308232
#define FRAME_RATE 30.0
#define MOST_FRAMES 1200
#define MOST_SAMPLES 30000

/* What is simulated; what is zero is taken as fits the case: 300 frames, 200 Hz, a consumer's part. */
struct rig {
    struct imu_mounting mounting;
    const char *grade;
    double imu_rate, still, speed, turn, noise_rad, noise_m;
    int frames;
    uint64_t seed;
};

static struct path_point points[MOST_FRAMES];
static struct path path = {0, points};
static fathom_imu_sample samples[MOST_SAMPLES];
static struct calibration_input input;
static struct calibration found;

static void simulate(const struct rig *rig) {
    struct scene scene;
    struct camera_path way;
    struct imu_model imu;
    const uint64_t key = random_key(rig->seed, 0xca1);
    const double rate = rig->imu_rate > 0 ? rig->imu_rate : 200;
    scene_make(&scene, SCENE_ROOM, rig->seed, 12);
    camera_path_make(&way, &scene, rig->still, rig->speed > 0 ? rig->speed : 1, rig->turn);
    imu_model_make(&imu, imu_grade_of(rig->grade ? rig->grade : "consumer"), &rig->mounting, rate, rig->seed);
    path.count = rig->frames ? rig->frames : 300;
    for (int i = 0; i < path.count; i++) {
        const double t = 0.4 + i / FRAME_RATE;
        double vector[3], error[9];
        struct camera_pose pose;
        camera_path_pose(&way, t, &pose);
        for (int k = 0; k < 3; k++) vector[k] = rig->noise_rad * random_normal(key, (uint64_t)(6 * i + k));
        rotation_of_vector(vector, error);
        memset(&points[i], 0, sizeof points[i]);
        points[i].timestamp_ns = llround(1e9 * t);
        points[i].state = i ? FATHOM_TRACKED : FATHOM_FIRST;
        points[i].pose[15] = 1;
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++)
                for (int k = 0; k < 3; k++)
                    points[i].pose[4 * r + c] += (float)(pose.rotation[3 * r + k] * error[3 * k + c]);
            points[i].pose[4 * r + 3] =
                (float)(pose.position[r] + rig->noise_m * random_normal(key, (uint64_t)(6 * i + 3 + r)));
        }
    }
    const double seconds = 0.8 + path.count / FRAME_RATE;
    input = (struct calibration_input){.path = &path, .imu = samples, .offset_range = 0.5};
    for (; input.imu_count < MOST_SAMPLES && input.imu_count < seconds * rate; input.imu_count++) {
        struct imu_sample sample;
        fathom_imu_sample *out = &samples[input.imu_count];
        imu_model_next(&imu, &way, &sample);
        out->timestamp_ns = llround(1e9 * sample.stamp);
        for (int k = 0; k < 3; k++) {
            out->gyro[k] = (float)sample.gyro[k];
            out->accel[k] = (float)sample.accel[k];
        }
    }
    scene_free(&scene);
}

/* The error of the rotation found, about the camera's axes, radians. */
static void rotation_error(const double rotation_deg[3], double error[3]) {
    double vector[3], truth[9], left[9];
    for (int k = 0; k < 3; k++) vector[k] = rotation_deg[k] / DEGREES;
    rotation_of_vector(vector, truth);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            left[3 * r + c] = 0;
            for (int k = 0; k < 3; k++) left[3 * r + c] += found.rotation[3 * r + k] * truth[3 * c + k];
        }
    vector_of_rotation(left, error);
}

static double length(const double v[3]) {
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

#include <stdio.h>
static void try(void **state) {
    (void)state;
    static const char *grades[]={"ideal","consumer","phone"};
    for (int still=0;still<2;still++)
    for (int g=0;g<3;g++) {
    double zr = 0, zo = 0, zl = 0, er=0, eo=0, el=0, sr=0,so=0,sl=0,mr=0,mo=0;
    int n = 0;
    for (int s = 0; s < 24; s++) {
        const struct rig rig = {.mounting = {{10 * s - 170, 33 * (s % 5), 7 * s - 100}, {0.03, -0.02, 0.05}, 0.005 * s - 0.1},
            .grade = grades[g], .turn = 1, .noise_rad = 1e-3, .noise_m = 1e-3, .seed = 10+s,
            .frames = 300, .still = still ? 0.5 : -2};
        simulate(&rig);
        int o = calibration_solve(&input, &found);
        double e[3]; rotation_error(rig.mounting.rotation_deg, e);
        if (o) printf("%d: %d \n", s, o);
        n++;
        for (int k = 0; k < 3; k++) { zr += pow(e[k]/found.rotation_sigma[k],2)/3; double d=found.lever[k]-rig.mounting.translation[k]; zl += pow(d/found.lever_sigma[k],2)/3; er+=e[k]*e[k]/3; el+=d*d/3; sr+=pow(found.rotation_sigma[k],2)/3; sl+=pow(found.lever_sigma[k],2)/3;}
        double d = found.offset-rig.mounting.clock_offset; zo += d*d/pow(found.offset_sigma,2); eo += d*d; so+=pow(found.offset_sigma,2);
        mr = fmax(mr, length(e)*DEGREES); mo=fmax(mo,1e3*fabs(d));
    }
    printf("%s %d z: rot %.2f off %.2f lever %.2f; rms rot %.4f deg (%.4f) max %.3f off %.3f ms (%.3f) max %.2f lever %.2f mm (%.2f)\n", grades[g], still, sqrt(zr/n), sqrt(zo/n), sqrt(zl/n), DEGREES*sqrt(er/n),DEGREES*sqrt(sr/n), mr, 1e3*sqrt(eo/n),1e3*sqrt(so/n), mo,1e3*sqrt(el/n),1e3*sqrt(sl/n));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(try)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
