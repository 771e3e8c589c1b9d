/* The frames of a capture, with their sizes, from C: list_capture PATH */
#include <scanshade/scanshade.h>

#include <stdio.h>

int main(int count, char** words) {
    scanshade_capture* capture = NULL;
    if (count != 2 || scanshade_capture_open(words[1], NULL, 0, &capture) != SCANSHADE_OK) {
        fprintf(stderr, "%s\n", count == 2 ? scanshade_last_error() : "list_capture PATH");
        return 1;
    }
    for (int64_t i = 0; i < scanshade_capture_count(capture); ++i) {
        scanshade_frame* frame = NULL;
        scanshade_frame_data data = SCANSHADE_FRAME_DATA_INIT;
        if (scanshade_capture_load(capture, i, &frame) == SCANSHADE_OK &&
            scanshade_frame_get(frame, &data) == SCANSHADE_OK)
            printf("%s: %dx%d %s\n", data.name, data.width, data.height, data.depth_m ? "pixels" : "points");
        else
            printf("frame %d: %s\n", (int)i, scanshade_last_error());
        scanshade_frame_free(frame);
    }
    scanshade_capture_close(capture);
    return 0;
}
