/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Runs a fuzz target over files and folders of kept samples, without libFuzzer. */
#include "tests/fuzz/fuzz.h"

#include <dirent.h>
#include <string.h>

static long samples;

static void replay_file(const char *path)
{
    enum { SAMPLE_BYTES_MAX = 1 << 20 };
    uint8_t *bytes = malloc(SAMPLE_BYTES_MAX);
    FILE *file = fopen(path, "rb");
    MUST(bytes != NULL && file != NULL);
    const size_t size = fread(bytes, 1, SAMPLE_BYTES_MAX, file);
    (void)fclose(file);
    /* A buffer of just this size lets the address sanitizer see one byte too many. */
    uint8_t *exact = realloc(bytes, size > 0 ? size : 1);
    MUST(exact != NULL);
    (void)LLVMFuzzerTestOneInput(exact, size);
    free(exact);
    samples++;
}

static void replay_folder(const char *folder)
{
    char path[4096];
    DIR *listing = opendir(folder);
    MUST(listing != NULL);
    for (const struct dirent *entry; (entry = readdir(listing)) != NULL;) {
        if (entry->d_name[0] == '.') continue;
        const int length = snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        MUST(length > 0 && (size_t)length < sizeof path);
        replay_file(path);
    }
    (void)closedir(listing);
}

int main(int argc, char **argv)
{
    for (int i = 1; i < argc; i++) replay_folder(argv[i]);
    (void)printf("%ld samples\n", samples);
    return samples > 0 ? 0 : 1;
}
