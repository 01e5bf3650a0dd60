#include "fathom/shell/near_name.h"

#include <string.h>

static int least(int a, int b, int c) {
    const int ab = a < b ? a : b;
    return ab < c ? ab : c;
}

/* Letters to insert, leave out, change or swap with their neighbours (optimal string alignment). */
static int distance(const char *a, const char *b) {
    enum { ROOM = 48 };
    int rows[3][ROOM + 1];
    int *before = rows[0], *last = rows[1], *now = rows[2];
    const int length_a = (int)strlen(a), length_b = (int)strlen(b);
    if (length_a > ROOM || length_b > ROOM) return ROOM;
    for (int j = 0; j <= length_b; j++) before[j] = last[j] = j;
    for (int i = 1; i <= length_a; i++) {
        now[0] = i;
        for (int j = 1; j <= length_b; j++) {
            now[j] = least(last[j] + 1, now[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1]));
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] && before[j - 2] + 1 < now[j])
                now[j] = before[j - 2] + 1;
        }
        int *const oldest = before;
        before = last;
        last = now;
        now = oldest;
    }
    return last[length_b];
}

int near_name_distance(const char *name, const char *known) {
    const size_t length = strlen(name);
    return length > 4 && strncmp(known, name, length) == 0 ? 1 : distance(name, known);
}

int near_name_limit(const char *name) {
    return strlen(name) < 2 ? 1 : 1 + (int)(strlen(name) - 2) / 5;
}
