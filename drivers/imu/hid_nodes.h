/* The kernel's HID devices, from sysfs. hidapi's own list (0.13) crashes when a device is removed meanwhile, and has no
 * report descriptors. */
#ifndef FATHOM_HID_NODES_H
#define FATHOM_HID_NODES_H

#include "imu/hid_descriptor.h"
#include "imu/hid_models.h"

#define HID_NODES 64 /* as many as the kernel has */

typedef struct {
    char path[32]; /* /dev/hidraw0 */
    uint16_t vendor, product;
    hid_bus bus;     /* HID_BUS_ANY: neither USB nor Bluetooth */
    char name[96];   /* maker and model, from the device */
    char serial[64]; /* over Bluetooth its address; "": none */
} hid_node;

/* Lists them, sorted by number; returns their number. Needs no permission. */
int hid_nodes_list(hid_node nodes[HID_NODES]);

/* Reads HID_ID, HID_NAME and HID_UNIQ from a uevent file's text; false: no HID_ID. */
bool hid_node_parse(hid_node *node, const char *uevent);

/* False: it is gone, or its descriptor is invalid. */
bool hid_node_descriptor(const hid_node *node, hid_descriptor *descriptor);

#endif
