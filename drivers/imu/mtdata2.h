/* Xsens/Movella's binary protocol ("Xbus", MT Low Level Communication Protocol): messages in a byte stream, and the
 * inertial data in MTData2 messages. No heap. */
#ifndef FATHOM_MTDATA2_H
#define FATHOM_MTDATA2_H

#include "imu/imu_reading.h"

#define XBUS_MOST_DATA 2048 /* the protocol's limit for an extended message */

enum {
    XBUS_GO_TO_MEASUREMENT = 0x10,
    XBUS_GO_TO_CONFIG = 0x30,
    XBUS_MTDATA2 = 0x36,
    XBUS_ERROR = 0x42,
    XBUS_SET_OUTPUT_CONFIGURATION = 0xC0
};

/* A message being gathered. All zero: none yet. */
typedef struct {
    uint8_t bytes[7 + XBUS_MOST_DATA];
    size_t have;
    int64_t skipped, broken; /* bytes between messages; messages with a wrong checksum or length */
} xbus_parser;

typedef struct {
    uint8_t id;
    const uint8_t *data; /* in the parser, until its next call */
    size_t length;
} xbus_message;

/* Takes bytes until a message is complete: returns the number of bytes taken; *whole: a message is complete. Call again
 * with the rest. After a message with a wrong checksum the search continues right behind its first byte. */
size_t xbus_take(xbus_parser *parser, const uint8_t *bytes, size_t length, xbus_message *message,
                 bool *whole);

/* Builds a message; returns its length, 0 when it doesn't fit. */
size_t xbus_build(uint8_t *out, size_t capacity, uint8_t id, const uint8_t *data, size_t length);

/* State between MTData2 messages. All zero at start. */
typedef struct {
    whole_counter clock; /* SampleTimeFine, 0.1 ms */
    bool counting;
    uint16_t counter; /* PacketCounter */
    int64_t last_ns;  /* of the last message with a time */
    bool has_last;
} mtdata2_state;

typedef enum { MTDATA2_READING, MTDATA2_OTHER, MTDATA2_MALFORMED } mtdata2_result;

/* Parses an MTData2 message's data: rate of turn and acceleration (or the high-rate ones), else delta q and delta v
 * over the time since the previous message; sample time, packet counter. Float32, float64, fixed-point 12.20 and 16.32.
 * OTHER: it has no rates or accelerations, or deltas without a time. */
mtdata2_result mtdata2_read(mtdata2_state *state, const uint8_t *data, size_t length, int64_t arrival_ns,
                            imu_reading *reading);

#endif
