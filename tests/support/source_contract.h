/* What every source owes, whatever its driver; each driver's test runs it. */
#ifndef FATHOM_TEST_SOURCE_CONTRACT_H
#define FATHOM_TEST_SOURCE_CONTRACT_H

#include "fathom_drivers.h"

/* Opens uri and starts, starts again, stops and closes it in every order. stir: makes the device send something; NULL: it
 * sends by itself. */
void check_source_contract(const char *uri, void (*stir)(void));

#endif
