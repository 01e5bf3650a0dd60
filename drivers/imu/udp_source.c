/* A phone's inertial sensors by UDP datagrams: udp_lines.h has the formats. */
#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <math.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "address.h"
#include "imu/imu_source.h"
#include "monotonic.h"
#include "source_log.h"
#include "imu/udp_lines.h"

#define USUAL_PORT "5555"
#define MOST_BYTES 8192       /* of a datagram */
#define MOST_AT_ONCE 256      /* maximum datagrams per poll, which must return to notice a stop */
#define ANOTHER_NS 2000000000 /* a sender silent for this time may be replaced by another one */
#define BUFFER_BYTES (1 << 20)

typedef struct {
    imu_source base;
    source_address address;
    udp_format format;
    double time_unit, gyro_unit, accel_unit; /* seconds, rad/s and m/s^2 per unit of the sent values */
    struct sockaddr_storage wanted;          /* family 0: any sender */
    int socket;
    struct sockaddr_storage sender; /* family 0: none yet */
    int64_t heard_ns;
    bool counting;
    int64_t count;
    uint32_t overflows; /* the kernel's count of dropped datagrams */
} udp_source;

/* ---- settings ---- */

typedef struct {
    const char *name;
    double value;
} choice;

static bool choose(udp_source *s, const char *key, const choice *choices, double *value) {
    const char *given = address_setting(&s->address, key);
    if (!given) {
        *value = choices->value;
        return true;
    }
    char names[128] = "";
    for (const choice *c = choices; c->name; c++) {
        if (!strcmp(c->name, given)) {
            *value = c->value;
            return true;
        }
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", *names ? ", " : "", c->name);
    }
    source_fail(&s->base.base.options, FATHOM_ERROR_ARGUMENT, "udp: %s=%s: it is one of %s", key, given,
                names);
    return false;
}

static bool read_settings(udp_source *s) {
    static const choice formats[] = {
        {"any", UDP_FORMAT_ANY}, {"csv", UDP_FORMAT_CSV}, {"json", UDP_FORMAT_JSON}, {NULL, 0}};
    static const choice times[] = {{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}, {NULL, 0}};
    static const choice rates[] = {{"rad", 1}, {"deg", RADIANS_PER_DEGREE}, {NULL, 0}};
    static const choice forces[] = {{"m", 1}, {"g", STANDARD_GRAVITY}, {NULL, 0}};
    static const choice signs[] = {{"force", 1}, {"gravity", -1}, {NULL, 0}};
    double format, sign;
    if (!choose(s, "format", formats, &format) || !choose(s, "time", times, &s->time_unit) ||
        !choose(s, "gyro", rates, &s->gyro_unit) || !choose(s, "accel", forces, &s->accel_unit) ||
        !choose(s, "sign", signs, &sign))
        return false;
    s->format = (udp_format)format;
    s->accel_unit *= sign;
    return true;
}

/* A numeric address, with an optional port; false: invalid. */
static bool resolve(const char *host, const char *port, struct sockaddr_storage *out, socklen_t *length) {
    const struct addrinfo hints = {.ai_socktype = SOCK_DGRAM, .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV};
    struct addrinfo *found;
    if (getaddrinfo(host, port, &hints, &found)) return false;
    memset(out, 0, sizeof *out);
    memcpy(out, found->ai_addr, found->ai_addrlen);
    *length = found->ai_addrlen;
    freeaddrinfo(found);
    return true;
}

/* "", "host:port" or "[host]:port". */
static bool split(const char *what, char host[128], char port[16]) {
    snprintf(host, 128, "127.0.0.1");
    snprintf(port, 16, USUAL_PORT);
    if (!*what) return true;
    const bool bracket = *what == '[';
    const char *end = bracket ? strchr(what, ']') : strrchr(what, ':');
    const char *colon = bracket && end ? end + 1 : end;
    if (!end || *colon != ':' || end - what - bracket >= 128 || strlen(colon + 1) >= 16) return false;
    snprintf(host, 128, "%.*s", (int)(end - what - bracket), what + bracket);
    snprintf(port, 16, "%s", colon + 1);
    char *rest;
    const long number = strtol(port, &rest, 10);
    return *host && *port && !*rest && number > 0 &&
           number < 65536; /* getaddrinfo takes larger ones modulo 65536 */
}

/* ---- opening ---- */

static void shut(imu_source *base) {
    udp_source *s = (udp_source *)base;
    if (s->socket >= 0) close(s->socket);
    s->socket = -1;
}

static int bind_failed(udp_source *s, bool quiet) {
    const int error = errno == EADDRINUSE      ? FATHOM_ERROR_BUSY
                      : errno == EACCES        ? FATHOM_ERROR_PERMISSION
                      : errno == EADDRNOTAVAIL ? FATHOM_ERROR_NO_DEVICE
                                               : FATHOM_ERROR_UNSUPPORTED;
    const char *fix = errno == EADDRINUSE ? ": another program listens there; choose another port"
                      : errno == EACCES   ? ": ports below 1024 need root; choose another"
                      : errno == EADDRNOTAVAIL
                          ? ": not an address of this machine; 'fathom devices' lists them"
                          : "";
    return quiet ? error
                 : source_fail(&s->base.base.options, error, "udp:%s: %s%s", s->address.what, strerror(errno),
                               fix);
}

static int open_socket(imu_source *base, bool quiet) {
    udp_source *s = (udp_source *)base;
    struct sockaddr_storage local;
    socklen_t length;
    char host[128], port[16], name[96];
    const int yes = 1, bytes = BUFFER_BYTES;
    if (!split(s->address.what, host, port) || !resolve(host, port, &local, &length))
        return source_fail(
            &base->base.options, FATHOM_ERROR_ARGUMENT,
            "udp:%s: should be udp:ADDRESS:PORT with this machine's address in numbers ([...] around IPv6)",
            s->address.what);
    s->socket = socket(local.ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (s->socket < 0 || bind(s->socket, (struct sockaddr *)&local, length)) return bind_failed(s, quiet);
    setsockopt(s->socket, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    setsockopt(s->socket, SOL_SOCKET, SO_RXQ_OVFL, &yes, sizeof yes);
    s->overflows = 0;
    snprintf(name, sizeof name, "phone by UDP at %.60s",
             *s->address.what ? s->address.what : "127.0.0.1:" USUAL_PORT);
    imu_source_describe(base, name, "", false);
    return FATHOM_OK;
}

static int begin(imu_source *base) {
    udp_source *s = (udp_source *)base;
    s->sender.ss_family = 0;
    s->counting = false;
    char old[1];
    while (recv(s->socket, old, sizeof old, MSG_DONTWAIT | MSG_TRUNC) >=
           0) { /* sent before the source was started */
    }
    return FATHOM_OK;
}

/* ---- datagrams ---- */

static bool same_host(const struct sockaddr_storage *a, const struct sockaddr_storage *b) {
    if (a->ss_family != b->ss_family) return false;
    if (a->ss_family == AF_INET)
        return ((const struct sockaddr_in *)a)->sin_addr.s_addr ==
               ((const struct sockaddr_in *)b)->sin_addr.s_addr;
    return !memcmp(&((const struct sockaddr_in6 *)a)->sin6_addr, &((const struct sockaddr_in6 *)b)->sin6_addr,
                   16);
}

static uint16_t port_of(const struct sockaddr_storage *a) {
    return a->ss_family == AF_INET ? ((const struct sockaddr_in *)a)->sin_port
                                   : ((const struct sockaddr_in6 *)a)->sin6_port;
}

/* One phone at a time: its clock is tracked. Another may replace it when it is silent. */
static bool admit(udp_source *s, const struct sockaddr_storage *from, int64_t now_ns) {
    if (s->wanted.ss_family && !same_host(&s->wanted, from)) return false;
    const bool same =
        s->sender.ss_family && same_host(&s->sender, from) && port_of(&s->sender) == port_of(from);
    if (!same && s->sender.ss_family && now_ns - s->heard_ns < ANOTHER_NS) return false;
    if (!same) {
        s->sender = *from;
        s->counting = false;
        imu_stream_restart(&s->base.stream, false);
    }
    s->heard_ns = now_ns;
    return true;
}

static bool take_line(udp_source *s, const char *text, size_t length, int64_t arrival_ns) {
    udp_line line;
    const udp_line_result result = udp_line_parse(s->format, text, length, &line);
    const double ns = line.time * s->time_unit * 1e9;
    if (result == UDP_LINE_OTHER) return true;
    if (result == UDP_LINE_MALFORMED || !(fabs(ns) < 4e18)) return false;
    imu_reading reading = {.samples = 1, .times = 1, .device_ns = {llrint(ns)}};
    if (line.has_count) {
        if (s->counting && line.count > s->count + 1) reading.lost = line.count - s->count - 1;
        s->counting = true;
        s->count = line.count;
    }
    for (int i = 0; i < 3; i++) {
        reading.gyro[0][i] = line.gyro[i] * s->gyro_unit;
        reading.accel[0][i] = line.accel[i] * s->accel_unit;
    }
    reading.has_gyro = line.has_gyro;
    reading.has_accel = line.has_accel;
    imu_stream_take(&s->base.stream, &reading, arrival_ns);
    return true;
}

static void take_datagram(udp_source *s, const char *text, size_t length, int64_t arrival_ns) {
    while (length) {
        const char *end = memchr(text, '\n', length);
        const size_t line = end ? (size_t)(end - text) : length;
        if (!take_line(s, text, line, arrival_ns)) source_queue_count_malformed(&s->base.queue, 1);
        text += end ? line + 1 : line;
        length -= end ? line + 1 : line;
    }
}

/* False: there is none. */
static bool receive(udp_source *s) {
    char bytes[MOST_BYTES];
    union { /* aligned as the messages in it must be */
        struct cmsghdr header;
        char bytes[CMSG_SPACE(sizeof(uint32_t))];
    } control;
    struct sockaddr_storage from = {0};
    struct iovec into = {bytes, sizeof bytes};
    struct msghdr message = {.msg_name = &from,
                             .msg_namelen = sizeof from,
                             .msg_iov = &into,
                             .msg_iovlen = 1,
                             .msg_control = &control,
                             .msg_controllen = sizeof control};
    const ssize_t length = recvmsg(s->socket, &message, MSG_DONTWAIT);
    const int64_t now_ns = monotonic_now_ns();
    if (length < 0) return false;
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&message); c; c = CMSG_NXTHDR(&message, c))
        if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SO_RXQ_OVFL) {
            uint32_t overflows;
            memcpy(&overflows, CMSG_DATA(c), sizeof overflows);
            source_queue_count_lost(&s->base.queue, (int64_t)(uint32_t)(overflows - s->overflows));
            s->overflows = overflows;
        }
    if (message.msg_flags & MSG_TRUNC || !admit(s, &from, now_ns))
        source_queue_count_malformed(&s->base.queue, 1);
    else
        take_datagram(s, bytes, (size_t)length, now_ns);
    return true;
}

static int poll_socket(imu_source *base) {
    udp_source *s = (udp_source *)base;
    struct pollfd waiting = {.fd = s->socket, .events = POLLIN};
    if (poll(&waiting, 1, IMU_SOURCE_SLICE_MS) <= 0) return FATHOM_ERROR_TIMEOUT;
    for (int i = 0; i < MOST_AT_ONCE && receive(s); i++) {
    }
    return FATHOM_OK;
}

/* ---- the driver ---- */

static const imu_device device = {.open = open_socket, .begin = begin, .poll = poll_socket, .shut = shut};

/* A phone is unknown before it sends; it needs an address of this machine. */
static int udp_enumerate(fathom_source_found found, void *user, fathom_log log, void *log_user) {
    (void)log;
    (void)log_user;
    fathom_source_info info = {.struct_size = sizeof info, .driver = "udp"};
    struct ifaddrs *list = NULL;
    snprintf(info.name, sizeof info.name, "a phone's inertial sensors");
    snprintf(info.problem, sizeof info.problem,
             "a phone isn't seen before it sends: open udp:ADDRESS:" USUAL_PORT
             " and let it send there; addresses of this machine:");
    if (getifaddrs(&list) == 0)
        for (struct ifaddrs *a = list; a; a = a->ifa_next) {
            char host[64];
            const size_t used = strlen(info.problem);
            if (!a->ifa_addr || a->ifa_addr->sa_family != AF_INET || !(a->ifa_flags & IFF_UP)) continue;
            if (getnameinfo(a->ifa_addr, sizeof(struct sockaddr_in), host, sizeof host, NULL, 0,
                            NI_NUMERICHOST))
                continue;
            snprintf(info.problem + used, sizeof info.problem - used, " %s", host);
        }
    freeifaddrs(list);
    return found(user, &info) ? FATHOM_ERROR_STOPPED : 0;
}

static int open_source(fathom_source **source, const char *address, const fathom_source_options *options) {
    source_address parsed;
    if (!address_parse(&parsed, address))
        return source_fail(options, FATHOM_ERROR_ARGUMENT, "udp:%s: settings are ?key=value&key=value",
                           address);
    udp_source *s = (udp_source *)imu_source_make(sizeof *s, &device, options);
    if (!s) return FATHOM_ERROR_MEMORY;
    s->socket = -1;
    s->address = parsed;
    const char *from = address_setting(&s->address, "from");
    socklen_t length;
    int result = FATHOM_OK;
    if (!read_settings(s))
        result = FATHOM_ERROR_ARGUMENT;
    else if (from && !resolve(from, "0", &s->wanted, &length))
        result = source_fail(options, FATHOM_ERROR_ARGUMENT, "udp: from=%s: not an address in numbers", from);
    else if (address_unknown(&s->address))
        result =
            source_fail(options, FATHOM_ERROR_ARGUMENT,
                        "udp: no setting is called '%s'; there are: format, time, gyro, accel, sign, from",
                        address_unknown(&s->address));
    if (result) {
        fathom_source_close(&s->base.base);
        return result;
    }
    return imu_source_open(source, &s->base);
}

const source_driver udp_driver = {.name = "udp", .enumerate = udp_enumerate, .open = open_source};
