#include "imu/hid_nodes.h"

#include <stdio.h>
#include <string.h>

enum { BUS_IS_USB = 3, BUS_IS_BLUETOOTH = 5 };

/* The value of a line KEY=value; unprintable bytes become ?. */
static bool value_of(const char *text, const char *key, char *out, size_t size) {
    const size_t length = strlen(key);
    for (const char *line = text; line; line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL) {
        if (strncmp(line, key, length) || line[length] != '=') continue;
        size_t n = 0;
        for (const char *c = line + length + 1; *c && *c != '\n' && n + 1 < size; c++)
            out[n++] = *c >= ' ' && *c < 127 ? *c : '?';
        out[n] = 0;
        return true;
    }
    *out = 0;
    return false;
}

bool hid_node_parse(hid_node *node, const char *uevent) {
    char id[64];
    unsigned bus, vendor, product;
    if (!value_of(uevent, "HID_ID", id, sizeof id) || sscanf(id, "%x:%x:%x", &bus, &vendor, &product) != 3)
        return false;
    node->bus = bus == BUS_IS_USB ? HID_BUS_USB : bus == BUS_IS_BLUETOOTH ? HID_BUS_BLUETOOTH : HID_BUS_ANY;
    node->vendor = (uint16_t)vendor;
    node->product = (uint16_t)product;
    value_of(uevent, "HID_NAME", node->name, sizeof node->name);
    value_of(uevent, "HID_UNIQ", node->serial, sizeof node->serial);
    return true;
}

/* A file of /sys/class/hidraw/hidrawN/device; its length, 0: missing. */
static size_t read_file(const char *path, const char *file, void *out, size_t size) {
    char name[128];
    const char *base = strrchr(path, '/');
    snprintf(name, sizeof name, "/sys/class/hidraw/%s/device/%s", base ? base + 1 : path, file);
    FILE *in = fopen(name, "rb");
    if (!in) return 0;
    const size_t length = fread(out, 1, size, in);
    fclose(in);
    return length;
}

int hid_nodes_list(hid_node nodes[HID_NODES]) {
    int count = 0;
    for (int i = 0; i < HID_NODES; i++) {
        char text[2048];
        hid_node *node = &nodes[count];
        snprintf(node->path, sizeof node->path, "/dev/hidraw%d", i);
        const size_t length = read_file(node->path, "uevent", text, sizeof text - 1);
        text[length] = 0;
        if (length && hid_node_parse(node, text)) count++;
    }
    return count;
}

bool hid_node_descriptor(const hid_node *node, hid_descriptor *descriptor) {
    uint8_t bytes[HID_MAX_DESCRIPTOR];
    const size_t length = read_file(node->path, "report_descriptor", bytes, sizeof bytes);
    return length > 0 && hid_descriptor_parse(descriptor, bytes, length);
}
