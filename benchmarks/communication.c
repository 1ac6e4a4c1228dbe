/* Counts the messages of a rank, and its processor time within MPI; load it before MPI's library.
 *
 * Point-to-point messages are counted where they are sent, persistent ones each time that they are started.
 */
#define _GNU_SOURCE
#include <mpi.h>
#include <time.h>

enum { MOST = 1 << 16 }; /* persistent sends that live at a time */

static double messages, bytes, reductions, inside;
static struct
{
  MPI_Request request;
  double size;
} sends[MOST];
static int sends_made;

/* messages, bytes, reductions over all ranks, processor seconds outside MPI */
void counted(double* result)
{
  struct timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  result[0] = messages;
  result[1] = bytes;
  result[2] = reductions;
  result[3] = (double)now.tv_sec + 1e-9 * (double)now.tv_nsec - inside;
}

static double seconds(void)
{
  struct timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double size_of(int count, MPI_Datatype type)
{
  int each;
  PMPI_Type_size(type, &each);
  return (double)count * each;
}

static void sent(double size)
{
  messages += 1;
  bytes += size;
}

static void started(MPI_Request request)
{
  for (int i = 0; i < sends_made; ++i)
    if (sends[i].request == request)
      sent(sends[i].size);
}

#define TIMED(call)                                                                                                    \
  const double start = seconds();                                                                                      \
  const int result = call;                                                                                             \
  inside += seconds() - start;                                                                                         \
  return result

#define SEND(name)                                                                                                     \
  int MPI_##name(const void* data, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm)                       \
  {                                                                                                                    \
    sent(size_of(count, type));                                                                                        \
    TIMED(PMPI_##name(data, count, type, to, tag, comm));                                                              \
  }
SEND(Send)
SEND(Ssend)

#define BEGIN_SEND(name)                                                                                               \
  int MPI_##name(const void* data, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request* request) \
  {                                                                                                                    \
    sent(size_of(count, type));                                                                                        \
    TIMED(PMPI_##name(data, count, type, to, tag, comm, request));                                                     \
  }
BEGIN_SEND(Isend)
BEGIN_SEND(Issend)

int MPI_Send_init(const void* data, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request* request)
{
  const int result = PMPI_Send_init(data, count, type, to, tag, comm, request);
  if (sends_made < MOST)
  {
    sends[sends_made].request = *request;
    sends[sends_made++].size = size_of(count, type);
  }
  return result;
}

int MPI_Request_free(MPI_Request* request)
{
  for (int i = 0; i < sends_made; ++i)
    if (sends[i].request == *request)
      sends[i] = sends[--sends_made];
  return PMPI_Request_free(request);
}

int MPI_Start(MPI_Request* request)
{
  started(*request);
  TIMED(PMPI_Start(request));
}

int MPI_Startall(int count, MPI_Request requests[])
{
  for (int i = 0; i < count; ++i)
    started(requests[i]);
  TIMED(PMPI_Startall(count, requests));
}

int MPI_Allreduce(const void* data, void* found, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
  int ranks;
  PMPI_Comm_size(comm, &ranks);
  reductions += ranks > 1;
  TIMED(PMPI_Allreduce(data, found, count, type, op, comm));
}

/* Calls that wait: only their time counts. */
int MPI_Wait(MPI_Request* request, MPI_Status* status) { TIMED(PMPI_Wait(request, status)); }
int MPI_Waitall(int n, MPI_Request r[], MPI_Status s[]) { TIMED(PMPI_Waitall(n, r, s)); }
int MPI_Waitany(int n, MPI_Request r[], int* i, MPI_Status* s) { TIMED(PMPI_Waitany(n, r, i, s)); }
int MPI_Waitsome(int n, MPI_Request r[], int* k, int i[], MPI_Status s[]) { TIMED(PMPI_Waitsome(n, r, k, i, s)); }
int MPI_Test(MPI_Request* request, int* flag, MPI_Status* status) { TIMED(PMPI_Test(request, flag, status)); }
int MPI_Testall(int n, MPI_Request r[], int* flag, MPI_Status s[]) { TIMED(PMPI_Testall(n, r, flag, s)); }
int MPI_Probe(int from, int tag, MPI_Comm comm, MPI_Status* s) { TIMED(PMPI_Probe(from, tag, comm, s)); }
int MPI_Iprobe(int from, int tag, MPI_Comm comm, int* flag, MPI_Status* s)
{
  TIMED(PMPI_Iprobe(from, tag, comm, flag, s));
}
int MPI_Recv(void* data, int count, MPI_Datatype type, int from, int tag, MPI_Comm comm, MPI_Status* s)
{
  TIMED(PMPI_Recv(data, count, type, from, tag, comm, s));
}
int MPI_Barrier(MPI_Comm comm) { TIMED(PMPI_Barrier(comm)); }
int MPI_Bcast(void* data, int count, MPI_Datatype type, int root, MPI_Comm comm)
{
  TIMED(PMPI_Bcast(data, count, type, root, comm));
}
int MPI_Allgather(const void* a, int n, MPI_Datatype s, void* b, int m, MPI_Datatype t, MPI_Comm comm)
{
  TIMED(PMPI_Allgather(a, n, s, b, m, t, comm));
}
int MPI_Allgatherv(const void* a, int n, MPI_Datatype s, void* b, const int m[], const int at[], MPI_Datatype t,
                   MPI_Comm comm)
{
  TIMED(PMPI_Allgatherv(a, n, s, b, m, at, t, comm));
}
int MPI_Alltoall(const void* a, int n, MPI_Datatype s, void* b, int m, MPI_Datatype t, MPI_Comm comm)
{
  TIMED(PMPI_Alltoall(a, n, s, b, m, t, comm));
}
int MPI_Scan(const void* a, void* b, int n, MPI_Datatype t, MPI_Op op, MPI_Comm comm)
{
  TIMED(PMPI_Scan(a, b, n, t, op, comm));
}
int MPI_Exscan(const void* a, void* b, int n, MPI_Datatype t, MPI_Op op, MPI_Comm comm)
{
  TIMED(PMPI_Exscan(a, b, n, t, op, comm));
}
int MPI_Neighbor_alltoallv(const void* a, const int n[], const int at[], MPI_Datatype s, void* b, const int m[],
                           const int to[], MPI_Datatype t, MPI_Comm comm)
{
  TIMED(PMPI_Neighbor_alltoallv(a, n, at, s, b, m, to, t, comm));
}
