#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "camera/openni2_internal.h"

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static bool started; /* under the lock, as all of these */
static int holders;

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

/* Before the drivers are unloaded, their threads must have ended. */
static void shut_down(void) {
    openni2_lock();
    if (started && holders == 0) oniShutdown();
    started = false;
    openni2_unlock();
}

int openni2_hold(char *why, size_t size) {
    char words[256];
    openni2_lock();
    if (!started && oniInitialize(ONI_API_VERSION) == ONI_STATUS_OK) {
        started = true;
        atexit(shut_down);
    }
    if (started)
        holders++;
    else
        snprintf(why, size,
                 "libOpenNI2 can't start: %s; its drivers belong in the folder OpenNI2/Drivers beside "
                 "libOpenNI2.so "
                 "(Debian: package libopenni2-0)",
                 openni2_words(words, sizeof words));
    const bool held = started;
    openni2_unlock();
    return held ? FATHOM_OK : FATHOM_ERROR_NO_DEVICE;
}

void openni2_release(void) {
    openni2_lock();
    holders--;
    openni2_unlock();
}

/* ---- threads ---- */

struct openni2_worker {
    openni2_worker *next; /* of all there are */
    pthread_cond_t changed;
    void (*job)(void *user); /* NULL: nothing to do */
    void *user;
    bool hired;
};

static pthread_mutex_t office = PTHREAD_MUTEX_INITIALIZER;
static openni2_worker *workers; /* under `office`, as all that is in them */

static void *work(void *user) {
    openni2_worker *w = user;
    pthread_mutex_lock(&office);
    for (;;) {
        while (!w->job) pthread_cond_wait(&w->changed, &office);
        pthread_mutex_unlock(&office);
        w->job(w->user);
        pthread_mutex_lock(&office);
        w->job = NULL;
        pthread_cond_broadcast(&w->changed);
    }
    return NULL;
}

/* With `office` held. */
static openni2_worker *train(void) {
    pthread_t thread;
    openni2_worker *w = calloc(1, sizeof *w);
    if (!w) return NULL;
    pthread_cond_init(&w->changed, NULL);
    if (pthread_create(&thread, NULL, work, w)) {
        pthread_cond_destroy(&w->changed);
        free(w);
        return NULL;
    }
    pthread_detach(thread);
    w->next = workers;
    workers = w;
    return w;
}

openni2_worker *openni2_hire(void (*job)(void *user), void *user) {
    pthread_mutex_lock(&office);
    openni2_worker *w = workers;
    while (w && w->hired) w = w->next;
    if (!w) w = train();
    if (w) {
        w->hired = true;
        w->job = job;
        w->user = user;
        pthread_cond_broadcast(&w->changed);
    }
    pthread_mutex_unlock(&office);
    return w;
}

void openni2_dismiss(openni2_worker *w) {
    pthread_mutex_lock(&office);
    while (w->job) pthread_cond_wait(&w->changed, &office);
    w->hired = false;
    pthread_mutex_unlock(&office);
}
