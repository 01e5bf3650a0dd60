/* The HID devices that the kernel has, by sysfs. hidapi's own list (0.13) crashes when a device goes while it is made,
 * and has no report descriptors. */
#ifndef FATHOM_HID_NODES_H
#define FATHOM_HID_NODES_H

#include "imu/hid_descriptor.h"
#include "imu/hid_models.h"

#define HID_NODES 64 /* as many as the kernel has */

typedef struct {
    char path[32]; /* /dev/hidraw0 */
    uint16_t vendor, product;
    hid_bus bus;     /* HID_BUS_ANY: neither USB nor Bluetooth */
    char name[96];   /* maker and model, as the device says */
    char serial[64]; /* over Bluetooth its address; "": none */
} hid_node;

/* Lists them, by number; returns how many there are. Asks for no permission. */
int hid_nodes_list(hid_node nodes[HID_NODES]);

/* Reads HID_ID, HID_NAME and HID_UNIQ of a uevent file's text; false: there is no HID_ID. */
bool hid_node_parse(hid_node *node, const char *uevent);

/* False: it has gone, or its descriptor makes no sense. */
bool hid_node_descriptor(const hid_node *node, hid_descriptor *descriptor);

#endif
