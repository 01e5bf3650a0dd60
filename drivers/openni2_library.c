#include <stdio.h>
#include <string.h>

#include "openni2_internal.h"

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int holders; /* under the lock */

void openni2_lock(void) {
    pthread_mutex_lock(&lock);
}

void openni2_unlock(void) {
    pthread_mutex_unlock(&lock);
}

const char *openni2_words(char *text, size_t size) {
    const char *words = oniGetExtendedError();
    size_t length = 0;
    bool gap = false;
    for (; words && *words && length + 2 < size; words++) {
        const bool blank = strchr(" \t\r\n", *words) != NULL;
        if (!blank && gap && length) text[length++] = ' ';
        if (!blank) text[length++] = *words;
        gap = blank;
    }
    text[length] = 0;
    if (!length) snprintf(text, size, "libOpenNI2 gives no reason");
    return text;
}

int openni2_hold(char *why, size_t size) {
    char words[256];
    int result = FATHOM_OK;
    openni2_lock();
    if (holders == 0 && oniInitialize(ONI_API_VERSION) != ONI_STATUS_OK) {
        snprintf(why, size,
                 "libOpenNI2 can't start: %s; its drivers belong in the folder OpenNI2/Drivers beside "
                 "libOpenNI2.so "
                 "(Debian: package libopenni2-0)",
                 openni2_words(words, sizeof words));
        result = FATHOM_ERROR_NO_DEVICE;
    } else {
        holders++;
    }
    openni2_unlock();
    return result;
}

void openni2_release(void) {
    openni2_lock();
    if (--holders == 0) oniShutdown();
    openni2_unlock();
}
