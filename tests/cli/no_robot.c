/* SPDX-License-Identifier: Apache-2.0
 * A library that is no driver. */
int nothing_of_interest(void);
int nothing_of_interest(void) { return 0; }
