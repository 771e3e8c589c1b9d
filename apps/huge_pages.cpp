// Large arrays of the program in huge pages, where the system leaves the choice to programs ("madvise"). The kernel
// hands out memory page by page when it is first written: of a cloud of ten million points, reading the file took half
// of its time for that on a machine whose memory was its own. (Virtual machines that borrow theirs from a host pay for
// either kind of page: there it costs 6 % of such a run.) A library must not decide it for others, so this belongs to
// the program alone.
#include <cstddef>
#include <cstdlib>
#include <new>
#include <sys/mman.h>

namespace {

constexpr std::size_t huge_page = std::size_t(2) << 20;
constexpr std::size_t large = std::size_t(32)
                              << 20; // as main() sets it: the system gets these back when they are freed

void* allocated(std::size_t bytes) noexcept {
    if (bytes < large)
        return std::malloc(bytes > 0 ? bytes : 1);
    const std::size_t whole = (bytes + huge_page - 1) / huge_page * huge_page;
    void* const memory = whole >= bytes ? std::aligned_alloc(huge_page, whole) : nullptr;
    if (memory)
        (void)madvise(memory, bytes / huge_page * huge_page, MADV_HUGEPAGE); // a refusal costs time only
    return memory;
}

} // namespace

void* operator new(std::size_t bytes) {
    while (true) {
        if (void* const memory = allocated(bytes))
            return memory;
        const std::new_handler make_room = std::get_new_handler();
        if (!make_room)
            throw std::bad_alloc();
        make_room();
    }
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
