#include "inertial/clock_watch.h"

#include <math.h>

#define APART_NS 1e8 /* smaller leads are the jitter of frames' delivery, and harmless */
#define CONFIRM_NS                                                                                           \
    2e8 /* a leap is confirmed after this, while both clocks go on; a pause of the samples isn't */
#define NEAR_NS 5e7 /* resolution of the times of arrival; within it, no sample was lost in the leap */

static double between(int64_t from, int64_t to) {
    return (double)to - (double)from;
}

void clock_watch_samples(clock_watch *w, int64_t before_ns, int64_t after_ns) {
    if (fabs(between(before_ns, after_ns)) <= APART_NS) return;
    w->before_ns = before_ns;
    w->after_ns = after_ns;
}

/* Whether a leap of stamps explains the change of the lead. */
static void begin_doubt(clock_watch *w, int64_t frame_ns, int64_t newest_ns, int64_t period_ns,
                        double moved) {
    double frames = between(w->frame_ns, frame_ns), samples = between(w->sample_ns, newest_ns);
    double leap = between(w->before_ns, w->after_ns) - (double)period_ns;
    bool of_samples =
        w->before_ns != w->after_ns && moved > leap - frames - APART_NS && moved < leap + APART_NS;
    bool of_frames = w->before_ns == w->after_ns && frames > APART_NS && samples >= 0 &&
                     moved + w->lead < w->least - APART_NS && fabs(moved - (samples - frames)) < APART_NS;
    if (!of_samples && !of_frames) return;
    w->doubt = true;
    w->leap = of_samples ? leap : 0;
    w->lead_sum = 0;
    w->leads = 0;
    /* a leap back is detected late: samples were dropped as out of order since the last frame with samples */
    w->since_frame_ns = w->leap < 0 ? w->frame_ns : frame_ns;
    w->since_sample_ns = of_samples ? w->after_ns : w->sample_ns + 1;
}

int64_t clock_watch_frame(clock_watch *w, int64_t frame_ns, int64_t newest_ns, int64_t period_ns,
                          int64_t *from_ns) {
    double lead = between(frame_ns, newest_ns), moved = w->known ? lead - w->lead : 0;
    int64_t add = 0;
    if (!w->known) w->lead = w->least = lead;
    w->known = true;
    if (w->doubt && fabs(lead - w->lead_sum / w->leads) > APART_NS) w->doubt = false;
    if (!w->doubt && fabs(moved) > APART_NS) begin_doubt(w, frame_ns, newest_ns, period_ns, moved);
    if (w->doubt) {
        w->lead_sum += lead;
        w->leads++;
        double shift = w->lead_sum / w->leads - w->lead;
        if (w->leap != 0 && fabs(shift - w->leap) < NEAR_NS) shift = w->leap;
        if (between(w->since_frame_ns, frame_ns) >= CONFIRM_NS && fabs(shift) < 9e18) {
            add = -(int64_t)llround(shift);
            *from_ns = w->since_sample_ns;
            w->doubt = false;
        }
    } else {
        w->lead += moved / 8;
        w->least = fmin(w->least, lead);
    }
    w->frame_ns = frame_ns;
    w->sample_ns = newest_ns + add;
    w->before_ns = w->after_ns;
    return add;
}
