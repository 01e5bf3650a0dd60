/* Shared by the parts of the recording reader. Internal to drivers/. */
#ifndef FATHOM_RECORDING_INTERNAL_H
#define FATHOM_RECORDING_INTERNAL_H

#include "fathom_drivers.h"

struct recording {
    fathom_recording shown; /* first: the caller's pointer points here */
    char *folder;
    fathom_recording_frame *frames;
    fathom_imu_sample *imu;
    fathom_recording_pose *poses;
    char **confidence;    /* a file per frame, or NULL; NULL: none */
    bool has_calibration; /* calibration.txt exists */
    bool has_depth_scale; /* rig.txt has depth_scale */
    fathom_log log;
    void *log_user;
};

/* One line to the log. */
void recording_say(const struct recording *recording, fathom_log_level level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* The same as an error; returns code. */
int recording_fail(const struct recording *recording, int code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* folder/file, or file itself when it is absolute; from malloc. NULL without memory. */
char *recording_path(const struct recording *recording, const char *file);

/* Each reads one of the text files into the recording and logs its faults. A missing optional file is no error. */
int recording_read_frames(struct recording *recording);
int recording_read_calibration(struct recording *recording);
int recording_read_rig(struct recording *recording);
int recording_read_imu(struct recording *recording, const char *path); /* NULL: imu.txt, may be missing */
int recording_read_poses(struct recording *recording);

/* confidence.txt, where there is one; or the files of that folder with the frames' names, where there is one. */
int recording_read_confidence_list(struct recording *recording);
int recording_pair_confidence(struct recording *recording, const char *folder);

/* NULL when fx fy cx cy are plausible for images of that size, else their fault. */
const char *recording_intrinsics_fault(const fathom_pinhole *camera);

/* Checks the assumed depth scale with a few frames, and warns when it can't be right. */
int recording_judge_depth_scale(struct recording *recording);

#endif
