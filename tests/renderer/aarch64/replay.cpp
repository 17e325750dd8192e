// Runs launches that `record.py` has written, and writes the memory after each; for any processor.
//
// Arguments: folder. `table.h`, which the test writes, lists the kernels by name.
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "table.h"

typedef long long Word;

// what Warp's library has for its array accesses
extern "C" void _wp_assert(const char* text, const char* file, unsigned line) {
    fprintf(stderr, "%s:%u: %s\n", file, line, text);
    exit(5);
}

static std::vector<Word> read(FILE* file, size_t count) {
    std::vector<Word> words(count);
    if (count && fread(words.data(), sizeof(Word), count, file) != count) exit(3);
    return words;
}

static void replay(const std::string& path, Kernel run) {
    FILE* file = fopen((path + ".launch").c_str(), "rb");
    if (!file) exit(2);
    const auto head = read(file, 6);
    const auto sizes = read(file, head[0]), words = read(file, 4 * head[1]);
    std::vector<char*> blocks;
    for (Word size : sizes) {
        blocks.push_back((char*)aligned_alloc(64, (size + 127) / 64 * 64));
        if (fread(blocks.back(), 1, size, file) != (size_t)size) exit(4);
    }
    fclose(file);
    for (size_t i = 0; i < words.size(); i += 4)
        *(char**)(blocks[words[i]] + words[i + 1]) = blocks[words[i + 2]] + words[i + 3];
    run(blocks[head[2]] + head[3], blocks[head[4]] + head[5]);
    file = fopen((path + ".replayed").c_str(), "wb");
    for (size_t i = 0; i < blocks.size(); ++i) {
        fwrite(blocks[i], 1, sizes[i], file);
        free(blocks[i]);
    }
    fclose(file);
}

int main(int, char** given) {
    for (const auto& kernel : KERNELS) replay(std::string(given[1]) + "/" + kernel.name, kernel.run);
}
