/* The reader of a model file, which is mapped, not parsed. Little-endian; an array begins at a multiple of 8 bytes.
 *
 *   32 bytes    "epsmesh" and a zero byte; uint32: version, 0x01020304, number of arrays, 0; uint64: length of the file
 *   64 bytes    for each array: its name, filled up with zeros to 32 bytes; uint32: kind, rank, shape (4, 1 beyond the
 *               rank); uint64: where it begins. Kinds: 0 double, 1 float, 2 int32, 3 int16, 4 bytes.
 *   the arrays  in C order
 */
typedef struct {
    char magic[8];
    uint32_t version, order, count, zero;
    uint64_t size;
} file_head;

typedef struct {
    char name[32];
    uint32_t kind, rank, shape[4];
    uint64_t begin;
} file_array;

typedef struct {
    const unsigned char *data;
    uint64_t size;
    uint32_t count;
    epsmesh_flaw flaw;
    const char *name; /* of the array with the flaw */
} file;

enum { FLOAT64, FLOAT32, INT32, INT16, BYTES, KINDS, FILE_VERSION = 4, FILE_ORDER = 0x01020304 };

static void file_open(file *f, const void *data, size_t size) {
    file_head head;
    f->data = (const unsigned char *)data, f->size = size, f->count = 0, f->name = "", f->flaw = EPSMESH_FOREIGN;
    if (!data || size < sizeof head) return;
    memcpy(&head, data, sizeof head);
    if (memcmp(head.magic, "epsmesh", 8)) return;
    f->flaw = EPSMESH_HEADER; /* a machine of the other byte order reads another number, too */
    if (head.order != FILE_ORDER) return;
    f->flaw = EPSMESH_VERSION;
    if (head.version != FILE_VERSION) return;
    f->flaw = (uintptr_t)data % 8 ? EPSMESH_UNALIGNED : EPSMESH_CUT;
    if (f->flaw == EPSMESH_UNALIGNED || head.size != size || head.count > (size - sizeof head) / sizeof(file_array)) return;
    f->count = head.count, f->flaw = EPSMESH_SOUND;
}

/* Return an array by its name, kind and rank, with its shape; NULL, without a flaw, if the file has no such name. */
static const void *file_find(file *f, const char *name, uint32_t kind, uint32_t rank, uint32_t shape[4]) {
    static const unsigned char width[KINDS] = {8, 4, 4, 2, 1};
    file_array array;
    char wanted[sizeof array.name] = {0};
    uint64_t bytes;
    uint32_t i;
    memcpy(wanted, name, strlen(name));
    for (i = 0; i < f->count; i++) {
        memcpy(&array, f->data + sizeof(file_head) + i * sizeof array, sizeof array);
        if (!memcmp(array.name, wanted, sizeof wanted)) break;
    }
    if (i >= f->count || f->flaw) return NULL;
    f->name = name, f->flaw = EPSMESH_SHAPE;
    if (kind >= KINDS || array.kind != kind || array.rank != rank) return NULL;
    for (bytes = width[kind], i = 0; i < 4; i++) {
        shape[i] = array.shape[i];
        if (!shape[i] || bytes > f->size / shape[i] || (i >= rank && shape[i] != 1)) return NULL;
        bytes *= shape[i];
    }
    if (array.begin % 8 || array.begin > f->size || bytes > f->size - array.begin) return NULL;
    f->name = "", f->flaw = EPSMESH_SOUND;
    return f->data + array.begin;
}
