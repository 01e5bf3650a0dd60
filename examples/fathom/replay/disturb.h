/* Spoils frames of a recording on purpose: a covered lens, a bare wall, a card in front of the camera. Frame numbers
 * are the recording's, independent of the stride. */
#ifndef FATHOM_CLI_DISTURB_H
#define FATHOM_CLI_DISTURB_H

#include <stdbool.h>

#include "fathom_drivers.h"
#include "fathom/shell/option_values.h"

/* A wall, in the frame of the reference poses: all points x with normal . x = offset. */
struct disturb_wall {
    double normal[3], offset;
};

struct disturb {
    const fathom_recording *recording;
    const struct frame_ranges *outages, *walls, *cards;
    struct disturb_wall wall[MOST_RANGES];
    uint16_t card[MOST_RANGES]; /* depth in units */
};

/* Reads the frames that define the positions of walls and cards; pixels has room for one frame. Returns a CLI_ status,
 * after a message on errors, except for a frame that can't be read: that message is in the recording's log. */
int disturb_prepare(struct disturb *disturb, const fathom_recording *recording,
                    const struct frame_ranges *outages, const struct frame_ranges *walls,
                    const struct frame_ranges *cards, uint16_t *pixels);

/* Whether the frame is replaced by a blank one, a card or a wall, so that its file needn't be read. */
bool disturb_replaces(const struct disturb *disturb, int frame);

/* Fills in that frame. False after an error message when there is no reference pose for a wall. */
bool disturb_render(const struct disturb *disturb, int frame, uint16_t *pixels);

#endif
