/* Maps between axes that explain a misfit: the 48 signed permutations and the best rotation. */
#ifndef FATHOM_AXIS_MAPS_H
#define FATHOM_AXIS_MAPS_H

#define TIE 1.3 /* explanations that leave up to this many times more unexplained than the best, and */

double determinant(const double m[9]);
double angle_of(const double map[9]); /* of a rotation, 0..pi */

/* The k-th of the 48 signed permutations; returns how unlikely a mistake it is. */
int signed_permutation(int k, double map[9]);

/* The most likely signed permutation: the simplest of those whose misfit hardly exceeds the minimum. Returns its sum;
 * *rivals: number of others that are as simple. */
double best_permutation(const double gw[9], double scatter, double best_map[9], int *rivals);

/* The rotation R with the largest sum of R .* m, which is returned (Horn 1987). */
double best_rotation(const double m[9], double map[9]);

#endif
