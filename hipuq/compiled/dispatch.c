/* Of the kernels that were compiled, take the best one that the processor can run. */
#include <string.h>

#include "kernel.h"
#include "processor.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

extern const HipuqKernel hipuq_baseline;
#ifdef HAVE_AVX2
extern const HipuqKernel hipuq_avx2;
#endif
#ifdef HAVE_AVX512
extern const HipuqKernel hipuq_avx512;
#endif

/* The digest of the sources that the build gives: a library left over from others is not used. */
EXPORT uint64_t hipuq_sources(void) { return HIPUQ_SOURCES; }

/* The kernel of that name, or the best one if `name` is empty; NULL where it cannot run here. */
EXPORT const HipuqKernel *hipuq_kernel(const char *name)
{
    const HipuqKernel *able[3];
    int count = 0;
#ifdef HAVE_AVX512
    if (processor_has() & HAS_AVX512)
        able[count++] = &hipuq_avx512;
#endif
#ifdef HAVE_AVX2
    if (processor_has() & HAS_AVX2)
        able[count++] = &hipuq_avx2;
#endif
    able[count++] = &hipuq_baseline;
    for (int i = 0; i < count; i++)
        if (!*name || !strcmp(name, able[i]->name))
            return able[i];
    return NULL;
}
