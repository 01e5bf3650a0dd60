/* The errors of a structured-light depth camera (Kinect). */
#ifndef FATHOM_SENSOR_KINECT_H
#define FATHOM_SENSOR_KINECT_H

#include <stdbool.h>
#include <stdint.h>

/* Standard deviation of the depth of a surface seen head-on at z metres: Nguyen, Izadi, Lovell 2012,
 * "Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking", 3DIMPVT. */
double kinect_axial_sigma(double z);

/* Disparity times depth, pixels x metres, at the sensor's 640x480: its focal length times the distance from
 * projector to camera. */
#define KINECT_DISPARITY_PX_M 43.875

/* Whether the projector lights each pixel: 1, or 0 in the shadow of a nearer surface. depth and scale as for
 * kinect_measure. */
void kinect_lit(const float *depth, int width, int height, double scale, uint8_t *lit);

/* Turns true depth (metres, 0 where there is none) into measured depth, in place. cosine: of the angle between ray and
 * normal, as render_depth gives it. scale: pixels of this image per pixel of the 640x480 sensor (width / 640). The
 * result depends on seed, frame and the input only. False when out of memory. */
bool kinect_measure(float *depth, const float *cosine, int width, int height, double scale, uint64_t seed,
                    uint64_t frame);

#endif
