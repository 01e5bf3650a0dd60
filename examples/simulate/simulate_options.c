#include "simulate/simulate_options.h"
#include "fathom/shell/cli.h"

#include <unistd.h>

static bool set_grade(void *into, const char *option, const char *text) {
    struct simulate_options *o = into;
    o->grade = imu_grade_of(text);
    if (!o->grade) cli_error(CLI_USAGE, "%s: '%s' is none of consumer, phone, ideal", option, text);
    return o->grade != NULL;
}

static bool set_rotation(void *into, const char *option, const char *text) {
    struct simulate_options *o = into;
    return parse_numbers(option, text, 3, -360.0, 360.0, o->mounting.rotation_deg);
}

static bool set_translation(void *into, const char *option, const char *text) {
    struct simulate_options *o = into;
    return parse_numbers(option, text, 3, -10.0, 10.0, o->mounting.translation);
}

static bool set_sensor(void *into, const char *option, const char *text) {
    struct simulate_options *o = into;
    o->sensor = sensor_of(text);
    if (!o->sensor) cli_error(CLI_USAGE, "%s: '%s' is none of kinect, lidar, tof", option, text);
    return o->sensor != NULL;
}

#define AT(field) offsetof(struct simulate_options, field)

static const struct option_row scene[] = {
    {"--seed", "N", OPTION_WHOLE, AT(seed), 0, 1e9, .help = "the furniture, the path, the noise (default 1)"},
    {"--length", "M", OPTION_NUMBER, AT(length), 6.0, 10000.0,
     .help = "the corridor's, 6 to 10000 metres (default 12)"},
    {"--motion", "FOLDER", OPTION_TEXT, AT(motion),
     .help = "along FOLDER's groundtruth.txt; copies its imu.txt and rig.txt"},
    {"--frames", "N", OPTION_WHOLE, AT(frames), 1, SIMULATE_MOST_FRAMES,
     .help = "default: room 10 s, wall 8 s, desk 6.7 s, corridor by its length, with --motion as long as it "
             "lasts"},
    {"--speed", "F", OPTION_NUMBER, AT(speed), 0.01, 20.0,
     .help = "times the usual pace of 0.3 to 0.5 m/s and 25 deg/s (default 1)"},
    {"--turn", "F", OPTION_NUMBER, AT(turn), 0.0, 40.0,
     .help = "times the usual rate of turning (default: as --speed)"},
    {"--still", "S", OPTION_NUMBER, AT(still), 0.0, 3600.0,
     .help = "seconds of standing still at the start (default 0.5)"},
    {0}};

static const struct option_row camera[] = {
    {"--sensor", "kinect|lidar|tof", OPTION_PARSED, .parse = set_sensor,
     .help = "kinect: structured light, 640x480, 30 a second (default); lidar: a phone's, 256x192, 60 a "
             "second, filled "
             "in between few laser dots, with confidence.txt; tof: a time-of-flight camera, 512x424, 30 a "
             "second"},
    {"--rate", "HZ", OPTION_NUMBER, AT(rate), 1.0, 1000.0, .help = "frames a second (default: the sensor's)"},
    {"--clean", NULL, OPTION_FLAG, AT(clean),
     .help = "no sensor noise; an ideal IMU unless --imu-grade is given"},
    {"--size", "WxH", OPTION_SIZE, AT(size), 16, 4096, .help = "default: the sensor's"},
    {"--blur", NULL, OPTION_FLAG, AT(blur),
     .help = "what motion does while a depth picture is taken: a pixel reads the mean of what passes over "
             "it, nothing where an edge does, and rows are taken one after another; a stamp is the middle "
             "of the middle row's exposure"},
    {"--exposure", "S", OPTION_NUMBER, AT(exposure.exposure_s), 0.0, 0.033,
     .help = "how long a row is exposed, with --blur (default 0.008; 0 to 0.033)"},
    {"--rolling", "S", OPTION_NUMBER, AT(exposure.rolling_s), 0.0, 0.033,
     .help = "from the first row to the last, with --blur (default 0.01 with kinect, else 0; 0 to 0.033)"},
    {0}};

static const struct option_row imu[] = {
    {"--imu-grade", "consumer|phone|ideal", OPTION_PARSED, .parse = set_grade,
     .help = "consumer is a Bosch BMI270 (default)"},
    {"--imu-rate", "HZ", OPTION_NUMBER, AT(imu_rate), 10.0, 8000.0,
     .help = "samples per second (default 200)"},
    {"--imu-rotation", "X,Y,Z", OPTION_PARSED, .parse = set_rotation,
     .help = "mounting, rotation vector in degrees, v_camera = R v_imu (default 0.8,-1.2,90)"},
    {"--imu-translation", "X,Y,Z", OPTION_PARSED, .parse = set_translation,
     .help = "the IMU's origin in camera axes, metres (default 0.025,-0.01,0.004)"},
    {"--imu-clock-offset", "S", OPTION_NUMBER, AT(mounting.clock_offset), -10.0, 10.0,
     .help = "seconds to add to an IMU stamp to get the depth clock (default 0)"},
    {0}};

static const struct option_row run[] = {
    {"--threads", "N", OPTION_WHOLE, AT(threads), 1, 1024, .help = "default: as many as the machine has"},
    {"--force", NULL, OPTION_FLAG, AT(force),
     .help = "writes into a folder that holds other things (a recording there is replaced)"},
    {"--progress", NULL, OPTION_FLAG, AT(progress), .help = "shows progress even when stderr is no terminal"},
    {0}};

const struct option_group simulate_groups[] = {{"Scene and path", scene, 0},
                                               {"Depth camera", camera, 0},
                                               {"Inertial sensor", imu, 0},
                                               {"Run", run, 0},
                                               {0}};

int simulate_options_read(struct simulate_options *o, const struct command *command, int argc, char **argv) {
    *o = (struct simulate_options){
        .length = 12.0,
        .speed = 1.0,
        .turn = -1.0,
        .still = 0.5,
        .imu_rate = 200.0,
        .sensor = &sensor_kinect,
        .exposure = {-1.0, -1.0},
        .seed = 1,
        .threads = sysconf(_SC_NPROCESSORS_ONLN),
        .mounting = {.rotation_deg = {0.8, -1.2, 90.0}, .translation = {0.025, -0.010, 0.004}}};
    if (o->threads < 1) o->threads = 1;
    const int status = options_read(command, o, argc, argv);
    if (status) return status;
    if (!scene_kind_of(o->scene, &o->kind))
        return cli_error(CLI_USAGE, "simulate: no scene '%s'; there are room, wall, desk, corridor",
                         o->scene);
    if (o->turn < 0.0) o->turn = o->speed;
    if (!o->blur && (o->exposure.exposure_s >= 0.0 || o->exposure.rolling_s >= 0.0))
        return cli_error(CLI_USAGE, "simulate: --exposure and --rolling go with --blur");
    if (o->exposure.exposure_s < 0.0) o->exposure.exposure_s = o->sensor->exposure_s;
    if (o->exposure.rolling_s < 0.0) o->exposure.rolling_s = o->sensor->rolling_s;
    if (!o->size.width) o->size = (struct option_size){o->sensor->camera.width, o->sensor->camera.height};
    if (!(o->rate > 0.0)) o->rate = o->sensor->rate_hz;
    if (!o->grade) o->grade = imu_grade_of(o->clean ? "ideal" : "consumer");
    return CLI_DONE;
}
