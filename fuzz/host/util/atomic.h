/* There are no interrupts here. */
#define ATOMIC_RESTORESTATE
#define ATOMIC_BLOCK(how)
