/* Signed distances to a simulated scene's true surface: reads points, three doubles each in the scene's frame, from stdin and
 * writes a double for each to stdout. Usage: scene_distance SCENE SEED LENGTH <points >distances */
#include <stdio.h>
#include <stdlib.h>

#include "simulate/scene.h"

int main(int argc, char **argv) {
    enum scene_kind kind;
    struct scene scene;
    if (argc != 4 || !scene_kind_of(argv[1], &kind)) {
        fprintf(stderr, "usage: scene_distance room|wall|desk|corridor SEED LENGTH <points >distances\n");
        return 2;
    }
    if (!scene_make(&scene, kind, strtoull(argv[2], NULL, 10), atof(argv[3]))) {
        fprintf(stderr, "scene_distance: out of memory\n");
        return 1;
    }
    double p[3];
    while (fread(p, sizeof p, 1, stdin) == 1) {
        const double distance = scene_distance(&scene, p[0], p[1], p[2]);
        fwrite(&distance, sizeof distance, 1, stdout);
    }
    scene_free(&scene);
    return fflush(stdout) || ferror(stdout) ? 1 : 0;
}
