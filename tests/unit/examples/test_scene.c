/* The simulator: scenes, renderer, camera path, sensor and IMU models, picture files. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fathom/files/png_file.h"
#include "recording/image_file.h"
#include "simulate/camera_path.h"
#include "simulate/imu_model.h"
#include "simulate/sensor_kinect.h"

#define WIDTH 160
#define HEIGHT 120
#define PIXELS (WIDTH * HEIGHT)

static const struct render_camera small_camera = {WIDTH, HEIGHT, 146.25, 146.25, 79.625, 59.625};
static float depth[PIXELS], cosine[PIXELS], second[PIXELS];

static void world_point(const struct camera_pose *pose, int x, int y, double z, double p[3]) {
    const double c[3] = {(x - small_camera.cx) / small_camera.fx * z,
                         (y - small_camera.cy) / small_camera.fy * z, z};
    for (int i = 0; i < 3; i++) {
        const double *row = &pose->rotation[3 * i];
        p[i] = pose->position[i] + row[0] * c[0] + row[1] * c[1] + row[2] * c[2];
    }
}

static void rendered_depth_lies_on_the_surface(void **state) {
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        struct scene scene;
        struct camera_path path;
        assert_true(scene_make(&scene, (enum scene_kind)kind, 7, 20.0));
        camera_path_make(&path, &scene, 0.0, 1.0, 1.0);
        double worst = 0.0, worst_cosine = 0.0;
        long seen = 0, turned = 0;
        for (int i = 0; i < 12; i++) {
            struct camera_pose pose;
            camera_path_pose(&path, 0.9 * i, &pose);
            assert_true(render_depth(&scene, &small_camera, &pose, 30.0, 2, depth, cosine));
            for (int y = 0; y < HEIGHT; y++) {
                for (int x = 0; x < WIDTH; x++) {
                    double p[3], n[3], ray[3], along = 0.0, length = 0.0;
                    const double z = depth[y * WIDTH + x];
                    assert_true(z > 0.0); /* closed: every ray ends somewhere */
                    world_point(&pose, x, y, z, p);
                    worst = fmax(worst, fabs(scene_distance(&scene, p[0], p[1], p[2])));
                    /* Nothing before the hit: half way there is free. */
                    world_point(&pose, x, y, 0.5 * z, ray);
                    assert_true(scene_distance(&scene, ray[0], ray[1], ray[2]) > 0.0);
                    if ((x ^ y) & 7) continue;
                    scene_normal(&scene, p[0], p[1], p[2], n);
                    for (int k = 0; k < 3; k++) {
                        along -= n[k] * (p[k] - pose.position[k]);
                        length += (p[k] - pose.position[k]) * (p[k] - pose.position[k]);
                    }
                    seen++; /* at an edge of two faces the normal isn't defined: few pixels */
                    turned += fabs(along / sqrt(length) - cosine[y * WIDTH + x]) > 0.02;
                    worst_cosine = fmax(worst_cosine, cosine[y * WIDTH + x]);
                }
            }
        }
        assert_true(worst < 1e-4);
        assert_true(worst_cosine <= 1.0 + 1e-6);
        assert_true(turned < seen / 50);
        scene_free(&scene);
    }
}

static void distance_is_euclidean_in_free_space(void **state) {
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        struct scene scene;
        assert_true(scene_make(&scene, (enum scene_kind)kind, 3, 15.0));
        for (uint64_t i = 0; i < 3000; i++) {
            double p[3], n[3];
            for (int k = 0; k < 3; k++)
                p[k] = scene_random(&scene, 9000 + (uint64_t)k, i, scene.low[k], scene.high[k]);
            const double d = scene_distance(&scene, p[0], p[1], p[2]);
            if (d < 0.01) continue;
            /* Down the gradient by the distance itself is the surface, unless two surfaces are equally near.
             */
            scene_normal(&scene, p[0], p[1], p[2], n);
            const double e = 1e-3,
                         on = scene_distance(&scene, p[0] + e * n[0], p[1] + e * n[1], p[2] + e * n[2]);
            assert_true(on - d < e * (1.0 + 1e-6));
            if (on - d < e * (1.0 - 1e-6)) continue;
            assert_true(fabs(scene_distance(&scene, p[0] - d * n[0], p[1] - d * n[1], p[2] - d * n[2])) <
                        1e-4);
        }
        scene_free(&scene);
    }
}

static void threads_do_not_change_the_picture(void **state) {
    (void)state;
    struct scene scene;
    struct camera_path path;
    struct camera_pose pose;
    assert_true(scene_make(&scene, SCENE_ROOM, 2, 0.0));
    camera_path_make(&path, &scene, 0.0, 1.0, 1.0);
    for (int i = 0; i < 5; i++) {
        camera_path_pose(&path, 1.7 * i, &pose);
        assert_true(render_depth(&scene, &small_camera, &pose, 12.0, 1, depth, cosine));
        assert_true(render_depth(&scene, &small_camera, &pose, 12.0, 1 + i, second, NULL));
        assert_memory_equal(depth, second, sizeof depth);
    }
    scene_free(&scene);
}

static void seeds_differ_and_the_corridor_never_repeats(void **state) {
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        struct scene a, b, c;
        assert_true(scene_make(&a, (enum scene_kind)kind, 1, 20.0));
        assert_true(scene_make(&b, (enum scene_kind)kind, 1, 20.0));
        assert_true(scene_make(&c, (enum scene_kind)kind, 2, 20.0));
        assert_int_equal(a.count, b.count);
        assert_memory_equal(a.solids, b.solids, a.count * sizeof *a.solids);
        assert_true(a.count != c.count || memcmp(a.solids, c.solids, a.count * sizeof *a.solids));
        scene_free(&a);
        scene_free(&b);
        scene_free(&c);
    }
    struct scene scene;
    assert_true(scene_make(&scene, SCENE_CORRIDOR, 1, 60.0));
    for (double shift = 1.0; shift < 30.0; shift += 0.05) { /* no shift lays the passage onto itself */
        double most = 0.0;
        for (double x = 2.0; x < 28.0; x += 0.11)
            most = fmax(most, fabs(scene_distance(&scene, x, 0.75, 1.0) -
                                   scene_distance(&scene, x + shift, 0.75, 1.0)));
        assert_true(most > 0.05);
    }
    scene_free(&scene);
}

static void room_leaves_its_free_box(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 30; seed++) {
        struct scene scene;
        assert_true(scene_make(&scene, SCENE_ROOM, seed, 0.0));
        for (double x = -0.6; x < 0.95; x += 0.1)
            for (double y = -1.35; y < 0.5; y += 0.1)
                for (double z = 1.2; z < 2.1; z += 0.05)
                    assert_true(scene_distance(&scene, fmin(x, 0.9), fmin(y, 0.45), fmin(z, 2.05)) >= 0.6);
        scene_free(&scene);
    }
}

static void paths_keep_clear_of_furniture(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 30; seed++) {
        for (int kind = 0; kind < 4; kind++) {
            struct scene scene;
            struct camera_path path;
            struct camera_pose pose;
            assert_true(scene_make(&scene, (enum scene_kind)kind, seed, 30.0));
            camera_path_make(&path, &scene, 0.5, 1.0, 1.0);
            for (double t = 0.0; t < 60.0; t += 0.1) {
                camera_path_pose(&path, t, &pose);
                assert_true(scene_distance(&scene, pose.position[0], pose.position[1], pose.position[2]) >
                            0.15);
            }
            scene_free(&scene);
        }
    }
}

/* 1 / z of a plane is affine in the pixel: whether the picture is one plane to within 0.1 mm. */
static bool is_one_plane(void) {
    const double a = 1.0 / depth[0], right = 1.0 / depth[WIDTH - 1],
                 below = 1.0 / depth[(HEIGHT - 1) * WIDTH];
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const double z = 1.0 / (a + (right - a) * x / (WIDTH - 1) + (below - a) * y / (HEIGHT - 1));
            if (fabs(z - depth[y * WIDTH + x]) > 1e-4) return false;
        }
    return true;
}

static void wall_fills_the_view_for_two_seconds(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed < 6; seed++) {
        struct scene scene;
        struct camera_path path;
        struct camera_pose pose;
        int first = -1, last = -1, bare = 0;
        assert_true(scene_make(&scene, SCENE_WALL, seed, 0.0));
        camera_path_make(&path, &scene, 0.5, 1.0, 1.0);
        for (int i = 0; i < 240; i++) {
            camera_path_pose(&path, i / 30.0, &pose);
            assert_true(render_depth(&scene, &small_camera, &pose, 12.0, 2, depth, NULL));
            if (!is_one_plane()) continue;
            if (first < 0) first = i;
            last = i;
            bare++;
        }
        print_message("seed %d: bare from frame %d to %d\n", (int)seed, first, last);
        assert_in_range(bare, 50, 80);
        assert_int_equal(last - first + 1, bare); /* in one piece */
        assert_in_range(first, 60, 120);
        scene_free(&scene);
    }
}

static void noise_has_the_models_sigma(void **state) {
    (void)state;
    for (double z = 0.7; z < 5.0; z *= 1.42) {
        double sum = 0.0, square = 0.0, neighbours = 0.0;
        long n = 0;
        for (int i = 0; i < PIXELS; i++) cosine[i] = 1.0f;
        for (uint64_t frame = 0; frame < 6; frame++) {
            /* Steps of disparity are coarser than a fixed distance shows: spread the truth over some of them.
             */
            for (int i = 0; i < PIXELS; i++) depth[i] = (float)(z * (1.0 + 0.05 * i / PIXELS));
            memcpy(second, depth, sizeof second);
            assert_true(kinect_measure(depth, cosine, WIDTH, HEIGHT, 0.25, 5, frame));
            for (int i = 0; i < PIXELS; i++) {
                assert_true(depth[i] > 0.0f);
                const double scale = kinect_axial_sigma(second[i]), e = (depth[i] - second[i]) / scale;
                sum += e;
                square += e * e;
                n++;
                if (i % WIDTH) neighbours += e * (depth[i - 1] - second[i - 1]) / scale;
            }
        }
        const double sigma = sqrt(square / (double)n - sum / (double)n * (sum / (double)n));
        print_message("%.2f m: sigma %.3f of the model's, neighbours correlate by %.2f\n", z, sigma,
                      neighbours / square);
        assert_true(fabs(sigma - 1.0) < 0.08);
        assert_true(fabs(sum / (double)n) < 0.1);
        assert_true(neighbours / square > 0.3 && neighbours / square < 0.8);
    }
}

static void noise_loses_edges_and_grazing_surfaces(void **state) {
    (void)state;
    long lost_edge = 0, lost_shadow = 0, lost_grazing = 0, lost_flat = 0, lost_far = 0;
    for (int i = 0; i < PIXELS;
         i++) { /* a near card right of the middle, a wall, and too far a strip below */
        depth[i] = i % WIDTH < WIDTH / 2 ? 3.0f : 1.0f;
        if (i / WIDTH > HEIGHT - 10) depth[i] = 9.0f;
        cosine[i] = i / WIDTH < 40 ? 0.1f : 1.0f;
    }
    assert_true(kinect_measure(depth, cosine, WIDTH, HEIGHT, 0.25, 5, 0));
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const bool lost = depth[y * WIDTH + x] == 0.0f;
            if (y > HEIGHT - 6)
                lost_far += lost;
            else if (y < 36)
                lost_grazing += lost; /* 84 degrees: all of it */
            else if (y < HEIGHT - 14 && y > 44 && (x == WIDTH / 2 || x == WIDTH / 2 + 1))
                lost_edge += lost;
            else if (y < HEIGHT - 14 && y > 44 && x >= WIDTH / 2 - 6 && x < WIDTH / 2 - 3)
                lost_shadow += lost;
            else if (y < HEIGHT - 14 && y > 44 && (x < WIDTH / 2 - 12 || x > WIDTH / 2 + 12))
                lost_flat += lost;
        }
    assert_int_equal(lost_far, WIDTH * 5);
    assert_int_equal(lost_grazing, WIDTH * 36);
    assert_int_equal(lost_shadow, 3 * (HEIGHT - 14 - 45)); /* f b (1 / 1 m - 1 / 3 m) = 7.3 pixels wide */
    assert_int_equal(lost_flat, 0);
    assert_true(lost_edge > 20);
}

/* ---- IMU ---- */

static void multiply(const double a[9], const double b[9], double c[9]) {
    double r[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
    memcpy(c, r, sizeof r);
}

static void lever_point(const struct camera_pose *pose, const double lever[3], double p[3]) {
    for (int i = 0; i < 3; i++) {
        const double *r = &pose->rotation[3 * i];
        p[i] = pose->position[i] + r[0] * lever[0] + r[1] * lever[1] + r[2] * lever[2];
    }
}

/* Strapdown integration, written apart from the model: attitude by the mean rate, velocity by the mean of the
 * forces. */
static void integrated_imu_follows_the_path(void **state) {
    (void)state;
    const struct imu_mounting mounting = {{10.0, -25.0, 80.0}, {0.04, -0.02, 0.03}, 0.0123};
    const double rate = 2000.0;
    for (int kind = 0; kind < 4; kind++) {
        struct scene scene;
        struct camera_path path;
        struct imu_model imu;
        struct imu_sample a, b;
        struct camera_pose pose, later;
        double attitude[9], position[3], velocity[3] = {0, 0, 0}, truth[3], mount[9], v[3];
        assert_true(scene_make(&scene, (enum scene_kind)kind, 4, 20.0));
        camera_path_make(&path, &scene, 0.25, 1.5, 1.5);
        imu_model_make(&imu, imu_grade_of("ideal"), &mounting, rate, 1);
        for (int i = 0; i < 3; i++) v[i] = mounting.rotation_deg[i] * 0.017453292519943295;
        rotation_of_vector(v, mount);
        camera_path_pose(&path, 0.0, &pose);
        multiply(pose.rotation, mount, attitude); /* IMU to world */
        lever_point(&pose, mounting.translation, position);
        imu_model_next(&imu, &path, &a);
        for (int step = 0; step < 5 * (int)rate; step++) {
            double turn[9], half[9], mean[9], f[3];
            imu_model_next(&imu, &path, &b);
            const double dt = b.stamp - a.stamp;
            for (int i = 0; i < 3; i++) v[i] = 0.5 * (a.gyro[i] + b.gyro[i]) * dt;
            rotation_of_vector(v, turn);
            for (int i = 0; i < 3; i++) v[i] *= 0.5;
            rotation_of_vector(v, half);
            multiply(attitude, half, mean);
            for (int i = 0; i < 3; i++) f[i] = 0.5 * (a.accel[i] + b.accel[i]);
            for (int i = 0; i < 3; i++) {
                const double acceleration = mean[3 * i] * f[0] + mean[3 * i + 1] * f[1] +
                                            mean[3 * i + 2] * f[2] - (i == 2 ? STANDARD_GRAVITY : 0.0);
                position[i] += velocity[i] * dt + 0.5 * acceleration * dt * dt;
                velocity[i] += acceleration * dt;
            }
            multiply(attitude, turn, attitude);
            a = b;
        }
        camera_path_pose(&path, a.stamp + mounting.clock_offset, &later);
        lever_point(&later, mounting.translation, truth);
        double error = 0.0, transposed[9], wanted[9], difference[9];
        for (int i = 0; i < 3; i++) error += (position[i] - truth[i]) * (position[i] - truth[i]);
        multiply(later.rotation, mount, wanted);
        for (int i = 0; i < 9; i++) transposed[i] = wanted[i % 3 * 3 + i / 3];
        multiply(transposed, attitude, difference);
        vector_of_rotation(difference, v);
        const double angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
        print_message("%s: after 5 s %.4f mm and %.6f degrees off\n", scene_name(scene.kind),
                      1e3 * sqrt(error), angle * 57.29578);
        assert_true(sqrt(error) < 5e-4);
        assert_true(angle < 2e-5);
        scene_free(&scene);
    }
}

static void imu_at_rest_reads_up(void **state) {
    (void)state;
    const struct imu_mounting mounting = {{0, 0, 0}, {0.1, 0, 0}, -0.02};
    struct scene scene;
    struct camera_path path;
    struct imu_model imu;
    struct imu_sample s;
    struct camera_pose pose;
    assert_true(scene_make(&scene, SCENE_DESK, 1, 0.0));
    camera_path_make(&path, &scene, 1.0, 1.0, 1.0);
    camera_path_pose(&path, 0.0, &pose);
    imu_model_make(&imu, imu_grade_of("ideal"), &mounting, 100.0, 1);
    for (int i = 0; i < 90; i++) {
        imu_model_next(&imu, &path, &s);
        assert_true(fabs(s.stamp + mounting.clock_offset - i / 100.0) <
                    1e-6); /* offset: added to the stamp */
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(s.gyro[k]) < 1e-9);
            assert_true(fabs(s.accel[k] - STANDARD_GRAVITY * pose.rotation[6 + k]) < 1e-6);
        }
    }
    assert_true(s.accel[1] < -5.0); /* the camera looks down at the desk from above: its y axis points down */
    scene_free(&scene);
}

static void imu_noise_has_its_density(void **state) {
    (void)state;
    const struct imu_mounting mounting = {{0, 0, 0}, {0, 0, 0}, 0};
    struct scene scene;
    struct camera_path path;
    assert_true(scene_make(&scene, SCENE_DESK, 1, 0.0));
    camera_path_make(&path, &scene, 1000.0, 1.0, 1.0);
    struct imu_grade grade = *imu_grade_of("consumer");
    grade.gyro_step = grade.accel_step = 0.0;
    for (int k = 0; k < 2; k++) {
        const double rate = k ? 800.0 : 100.0;
        struct imu_model imu;
        struct imu_sample a, b;
        double gyro = 0.0, accel = 0.0;
        imu_model_make(&imu, &grade, &mounting, rate, 3);
        imu_model_next(&imu, &path, &a);
        for (int i = 0; i < 20000; i++) { /* differences of neighbours: free of bias and walk */
            imu_model_next(&imu, &path, &b);
            gyro += (b.gyro[0] - a.gyro[0]) * (b.gyro[0] - a.gyro[0]);
            accel += (b.accel[2] - a.accel[2]) * (b.accel[2] - a.accel[2]);
            a = b;
        }
        assert_true(fabs(sqrt(gyro / 40000.0) / (grade.gyro_noise * sqrt(rate)) - 1.0) < 0.05);
        assert_true(fabs(sqrt(accel / 40000.0) / (grade.accel_noise * sqrt(rate)) - 1.0) < 0.05);
    }
    scene_free(&scene);
}

/* ---- Files ---- */

static char folder[64];

static int make_folder(void **state) {
    (void)state;
    strcpy(folder, "/tmp/fathom-test-XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
    (void)state;
    return rmdir(folder);
}

static void measured_path_is_interpolated(void **state) {
    (void)state;
    char file[128], error[256];
    struct camera_path path;
    struct camera_pose pose;
    snprintf(file, sizeof file, "%s/groundtruth.txt", folder);
    FILE *out = fopen(file, "w");
    assert_non_null(out);
    /* The second quaternion stands for 90 degrees about z, with the other sign. */
    fputs("# t tx ty tz qx qy qz qw\n1.0 0 0 0 0 0 0 1\n\n2.0 2 4 6 0 0 -0.70710678 -0.70710678\n", out);
    fclose(out);
    assert_int_equal(camera_path_read(&path, file, error, sizeof error), 0);
    camera_path_pose(&path, 1.5, &pose);
    assert_true(fabs(pose.position[1] - 2.0) < 1e-12);
    assert_true(fabs(pose.rotation[0] - cos(0.7853981634)) < 1e-8 && pose.rotation[3] > 0.7);
    camera_path_pose(&path, 9.0, &pose);
    assert_true(fabs(pose.position[2] - 6.0) < 1e-12);
    camera_path_free(&path);

    static const char *const wrong[] = {"1 0 0 0 0 0 0 1\n",
                                        "1 0 0 0 0 0 0 1\n2 x\n",
                                        "1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n",
                                        "1 0 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n",
                                        "1 0 0 0 0 0 0 3\n2 0 0 0 0 0 0 1\n",
                                        ""};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        out = fopen(file, "w");
        assert_non_null(out);
        fputs(wrong[i], out);
        fclose(out);
        assert_int_equal(camera_path_read(&path, file, error, sizeof error), -1);
        assert_non_null(strstr(error, "groundtruth.txt"));
        assert_null(path.samples);
    }
    unlink(file);
    assert_int_equal(camera_path_read(&path, file, error, sizeof error), -1);
}

static uint16_t pixels_out[PIXELS], pixels_in[PIXELS];

static void pictures_survive_the_round_trip(void **state) {
    (void)state;
    char file[128], error[256];
    int width = 0, height = 0;
    snprintf(file, sizeof file, "%s/picture.png", folder);
    for (int i = 0; i < PIXELS; i++) pixels_out[i] = (uint16_t)(i * 40503u);
    assert_int_equal(image_write_gray16(file, pixels_out, WIDTH, HEIGHT, error, sizeof error), 0);
    assert_int_equal(image_read_size(file, &width, &height, error, sizeof error), 0);
    assert_int_equal(width, WIDTH);
    assert_int_equal(height, HEIGHT);
    width = height = 0;
    assert_int_equal(image_read_gray16(file, pixels_in, PIXELS, &width, &height, error, sizeof error), 0);
    assert_int_equal(width, WIDTH);
    assert_int_equal(height, HEIGHT);
    assert_memory_equal(pixels_in, pixels_out, sizeof pixels_in);
    assert_int_equal(image_read_gray16(file, pixels_in, PIXELS - 1, &width, &height, error, sizeof error),
                     -1);
    assert_non_null(strstr(error, "picture.png"));
    unlink(file);
}

static void bad_pictures_are_named(void **state) {
    (void)state;
    char file[128], error[256], *bytes;
    uint8_t colour[12 * 3] = {0};
    int width, height;
    snprintf(file, sizeof file, "%s/picture.png", folder);
    assert_int_equal(image_write_gray16(file, pixels_out, WIDTH, HEIGHT, error, sizeof error), 0);
    FILE *in = fopen(file, "rb");
    assert_non_null(in);
    bytes = malloc(4 * PIXELS);
    const size_t size = fread(bytes, 1, 4 * PIXELS, in);
    fclose(in);
    const size_t cuts[] = {0, 4, 8, 20, 40, 60, size / 2, size - 20, size - 6};
    for (size_t i = 0; i < sizeof cuts / sizeof cuts[0]; i++) { /* truncated */
        FILE *out = fopen(file, "wb");
        fwrite(bytes, 1, cuts[i], out);
        fclose(out);
        error[0] = 0;
        assert_int_equal(image_read_gray16(file, pixels_in, PIXELS, &width, &height, error, sizeof error),
                         -1);
        assert_non_null(strstr(error, "picture.png"));
        assert_null(strchr(error, '\n'));
    }
    for (size_t at = 8; at < size; at += size / 37) { /* corrupt: libpng checks every chunk's sum */
        FILE *out = fopen(file, "wb");
        bytes[at] ^= 0x55;
        fwrite(bytes, 1, size, out);
        bytes[at] ^= 0x55;
        fclose(out);
        if (image_read_gray16(file, pixels_in, PIXELS, &width, &height, error, sizeof error))
            assert_non_null(strstr(error, "picture.png"));
    }
    free(bytes);
    assert_true(png_write_rgb(file, colour, 4, 3));
    assert_int_equal(image_read_gray16(file, pixels_in, PIXELS, &width, &height, error, sizeof error), -1);
    assert_int_equal(image_read_size(file, &width, &height, error, sizeof error), 0);
    assert_int_equal(width, 4);
    unlink(file);
    assert_int_equal(image_read_size(file, &width, &height, error, sizeof error), -1);
    assert_false(png_write_rgb("/nowhere/at/all.png", colour, 4, 3));
    if (access("/dev/full", W_OK) == 0) { /* a full disk: the part file is a link to one */
        char part[160];
        snprintf(part, sizeof part, "%s.part", file);
        assert_int_equal(symlink("/dev/full", part), 0);
        assert_int_equal(image_write_gray16(file, pixels_out, WIDTH, HEIGHT, error, sizeof error), -1);
        assert_non_null(strstr(error, "No space left"));
        assert_int_not_equal(access(file, F_OK), 0);
        assert_int_equal(symlink("/dev/full", part), 0);
        assert_false(png_write_rgb(file, colour, 4, 3));
        assert_int_not_equal(access(file, F_OK), 0);
        assert_int_not_equal(access(part, F_OK), 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rendered_depth_lies_on_the_surface),
        cmocka_unit_test(distance_is_euclidean_in_free_space),
        cmocka_unit_test(threads_do_not_change_the_picture),
        cmocka_unit_test(seeds_differ_and_the_corridor_never_repeats),
        cmocka_unit_test(room_leaves_its_free_box),
        cmocka_unit_test(paths_keep_clear_of_furniture),
        cmocka_unit_test(wall_fills_the_view_for_two_seconds),
        cmocka_unit_test(noise_has_the_models_sigma),
        cmocka_unit_test(noise_loses_edges_and_grazing_surfaces),
        cmocka_unit_test(integrated_imu_follows_the_path),
        cmocka_unit_test(imu_at_rest_reads_up),
        cmocka_unit_test(imu_noise_has_its_density),
        cmocka_unit_test_setup_teardown(measured_path_is_interpolated, make_folder, remove_folder),
        cmocka_unit_test_setup_teardown(pictures_survive_the_round_trip, make_folder, remove_folder),
        cmocka_unit_test_setup_teardown(bad_pictures_are_named, make_folder, remove_folder),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
