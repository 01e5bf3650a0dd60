#include "hid_recording.h"

#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

static FILE *open_shared(const char *name) {
    char path[512];
    snprintf(path, sizeof path, "../shared/data/hid/%s", name);
    return fopen(path, "r");
}

static size_t read_bytes(const char *text, uint8_t *bytes, size_t capacity) {
    size_t n = 0;
    char *end;
    for (; n < capacity; n++, text = end) {
        const unsigned long value = strtoul(text, &end, 16);
        if (end == text) break;
        bytes[n] = (uint8_t)value;
    }
    return n;
}

int hid_recording_open(hid_recording *recording, const char *name) {
    *recording = (hid_recording){.file = open_shared(name)};
    if (!recording->file) return -1;
    static char line[65536];
    while (!recording->descriptor_length && fgets(line, sizeof line, recording->file))
        if (line[0] == 'R') {
            char *bytes;
            strtoul(line + 2, &bytes, 10);
            recording->descriptor_length =
                read_bytes(bytes, recording->descriptor, sizeof recording->descriptor);
        }
    return 0;
}

int hid_recording_next(hid_recording *recording) {
    static char line[65536];
    while (fgets(line, sizeof line, recording->file)) {
        if (line[0] != 'E') continue;
        char *rest;
        recording->at_ns = (int64_t)(strtod(line + 2, &rest) * 1e9);
        strtoul(rest, &rest, 10);
        recording->length = read_bytes(rest, recording->report, sizeof recording->report);
        return 1;
    }
    return 0;
}

void hid_recording_close(hid_recording *recording) {
    if (recording->file) fclose(recording->file);
}

size_t hid_recording_feature(const char *name, uint8_t id, uint8_t *bytes, size_t capacity) {
    FILE *file = open_shared(name);
    if (!file) return 0;
    char line[1024];
    size_t length = 0;
    while (fgets(line, sizeof line, file)) {
        char *rest;
        if (line[0] != '0' || strtoul(line, &rest, 16) != id || *rest != ':') continue;
        for (rest += strspn(rest, ": "); length < capacity; length++, rest += 2) {
            const char pair[3] = {rest[0], rest[0] ? rest[1] : 0, 0};
            char *end;
            const unsigned long value = strtoul(pair, &end, 16);
            if (end != pair + 2) break;
            bytes[length] = (uint8_t)value;
        }
    }
    fclose(file);
    return length;
}

int hid_recording_run(const char *group, const struct CMUnitTest *tests, size_t count, size_t real) {
    FILE *file = open_shared("dualsense-usb.hid");
    if (file) {
        fclose(file);
        return _cmocka_run_group_tests(group, tests, count, NULL, NULL);
    }
    const int failed = _cmocka_run_group_tests(group, tests, count - real, NULL, NULL);
    for (size_t i = count - real; i < count; i++) /* cmocka 1.1 would write "not ok" */
        printf("ok %zu - %s # SKIP no recordings of HID devices here\n", i + 1, tests[i].name);
    return failed;
}
