/* Worker threads that share the parallel loops of kernels, in place of Taichi's own threads. worker_threads.py installs them.
   Taichi reads the .bc file beside this file; tools/make/assemble_bitcode.py makes it.

   A loop is a number of blocks. The word `ticket` holds the number of the loop and the number of its blocks that no thread has
   taken yet. Each thread, the calling thread too, takes the next block by a compare-and-swap on `ticket`. The compare-and-swap
   fails if another thread has taken the block first, or if this loop has ended and the next loop has begun. */

typedef unsigned int u32;
typedef unsigned long long u64;
typedef void Task(char *context, int thread, int block);

/* Of Taichi 1.7.4. */
typedef struct LLVMRuntime LLVMRuntime;
typedef struct RuntimeContext {
  char *arguments;
  LLVMRuntime *runtime;
  int thread;
  u64 *result;
} RuntimeContext;
void LLVMRuntime_initialize_thread_pool(LLVMRuntime *runtime, char *pool, char *parallel_for);

/* Of the C library and Linux. */
long syscall(long number, ...);
int pthread_create(u64 *thread, void *attributes, void *(*start)(void *), void *argument);
int pthread_join(u64 thread, void **result);
int pthread_sigmask(int how, const void *set, void *old);
int clock_gettime(int clock, long long *time);
int getpid(void);
enum { SYS_PRCTL = 157, PR_SET_NAME = 15, SYS_FUTEX = 202, FUTEX_WAIT_PRIVATE = 128, FUTEX_WAKE_PRIVATE = 129, SIG_SETMASK = 2, CLOCK_MONOTONIC = 1 };

enum { MOST = 256, LOOKS = 32 };

static u32 posted;                /* number of loops so far; a worker waits until this word changes */
static u32 done;                  /* finished blocks of this loop; the caller waits until this word changes */
static u32 asleep, caller_asleep; /* how many threads sleep, or are about to sleep, until `posted` or `done` changes */
static u32 busy, stopping;
static u64 ticket;
static struct {
  Task *task;
  char *context;
  int blocks;
} loop;
static u64 thread_of[MOST];
static int workers, process;
static long long patience; /* ns for which a thread reads the word again and again before it sleeps */

static long long now(void) {
  long long time[2];
  clock_gettime(CLOCK_MONOTONIC, time);
  return time[0] * 1000000000 + time[1];
}

/* Wait until *word is no longer `value`. `sleepers` counts the threads that sleep until *word changes. */
static void await(u32 *word, u32 value, u32 *sleepers) {
  if (patience > 0) {
    long long begun = now();
    do {
      for (int k = 0; k < LOOKS; k++) {
        if (__atomic_load_n(word, __ATOMIC_ACQUIRE) != value) return;
        __builtin_ia32_pause();
      }
    } while (now() - begun < patience);
  }
  /* No wake-up is lost. The waiting thread first counts itself in *sleepers and then reads *word. The thread that changes *word
     first changes it and then reads *sleepers. All four accesses are sequentially consistent, so both threads see them in the
     same order. Either the change of *word comes before the read of *word: then the waiting thread reads the new value and does
     not sleep. Or the read of *word comes first: then the count in *sleepers, which came before it, comes before the read of
     *sleepers, and the changing thread calls wake. FUTEX_WAIT compares *word with `value` once more before the thread sleeps, so
     a wake that comes just before the thread sleeps is not lost either. */
  __atomic_add_fetch(sleepers, 1, __ATOMIC_SEQ_CST);
  while (__atomic_load_n(word, __ATOMIC_SEQ_CST) == value) syscall(SYS_FUTEX, word, FUTEX_WAIT_PRIVATE, value, 0, 0, 0);
  __atomic_sub_fetch(sleepers, 1, __ATOMIC_SEQ_CST);
}

static void wake(u32 *word, int most) { syscall(SYS_FUTEX, word, FUTEX_WAKE_PRIVATE, most, 0, 0, 0); }

/* Take blocks of the loop and do them, until no block is left. */
static void share(int thread) {
  u64 seen = __atomic_load_n(&ticket, __ATOMIC_ACQUIRE);
  while ((u32)seen != 0) {
    /* The fields of `loop` change only when no block is left. If the exchange succeeds, a block of the loop in `seen` was left
       until now, so the fields that were read belong to this loop. */
    Task *task = __atomic_load_n(&loop.task, __ATOMIC_RELAXED);
    char *context = __atomic_load_n(&loop.context, __ATOMIC_RELAXED);
    u32 blocks = __atomic_load_n(&loop.blocks, __ATOMIC_RELAXED);
    if (!__atomic_compare_exchange_n(&ticket, &seen, seen - 1, 0, __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) continue;
    task(context, thread, (int)(blocks - (u32)seen));
    if (__atomic_add_fetch(&done, 1, __ATOMIC_SEQ_CST) == blocks && __atomic_load_n(&caller_asleep, __ATOMIC_SEQ_CST))
      wake(&done, 1);
    seen = __atomic_load_n(&ticket, __ATOMIC_ACQUIRE);
  }
}

static void *work(void *argument) {
  int thread = (int)(long)argument;
  u32 seen = 0;
  syscall(SYS_PRCTL, PR_SET_NAME, "mpp_taichi", 0, 0, 0);
  while (!__atomic_load_n(&stopping, __ATOMIC_ACQUIRE)) {
    await(&posted, seen, &asleep);
    seen = __atomic_load_n(&posted, __ATOMIC_ACQUIRE);
    share(thread);
  }
  return 0;
}

/* Kernels call this function for each parallel loop. `threads` is the number of threads for which the kernel was compiled, at
   most the number of processors. It is not used: if there are more workers than processors, all of them take part. */
static void parallel_for(char *pool, int blocks, int threads, char *context, Task *task) {
  (void)pool, (void)threads;
  if (blocks <= 1 || workers == 0 || __atomic_exchange_n(&busy, 1, __ATOMIC_ACQUIRE)) {
    for (int k = 0; k < blocks; k++) task(context, 0, k); /* also if two threads of Python launch kernels at the same time */
    return;
  }
  __atomic_store_n(&loop.task, task, __ATOMIC_RELAXED);
  __atomic_store_n(&loop.context, context, __ATOMIC_RELAXED);
  __atomic_store_n(&loop.blocks, blocks, __ATOMIC_RELAXED);
  __atomic_store_n(&done, 0, __ATOMIC_RELAXED);
  __atomic_store_n(&ticket, (u64)(posted + 1) << 32 | (u32)blocks, __ATOMIC_RELEASE);
  __atomic_add_fetch(&posted, 1, __ATOMIC_SEQ_CST);
  if (__atomic_load_n(&asleep, __ATOMIC_SEQ_CST)) wake(&posted, blocks - 1);
  share(0);
  u32 finished;
  while ((finished = __atomic_load_n(&done, __ATOMIC_ACQUIRE)) != (u32)blocks) await(&done, finished, &caller_asleep);
  __atomic_store_n(&busy, 0, __ATOMIC_RELEASE);
}

/* End the workers. Later loops run on the calling thread only. A forked process has no workers to end. */
static void stop(void) {
  if (process != getpid()) return;
  __atomic_store_n(&stopping, 1, __ATOMIC_RELEASE);
  __atomic_add_fetch(&posted, 1, __ATOMIC_SEQ_CST);
  wake(&posted, MOST);
  for (int k = 0; k < workers; k++) pthread_join(thread_of[k], 0);
  workers = 0;
}

/* A kernel calls this function before `do_nothing`, because Taichi gives the runtime to `do_nothing` only. */
void prepare(int *wanted, int *nanoseconds, long long *address_of_stop) {
  workers = *wanted < MOST ? *wanted : MOST;
  patience = *nanoseconds;
  *address_of_stop = (long long)stop;
}

/* Start the workers and make them the threads of Taichi's runtime. Taichi has a function of this name for its own tests; in the
   kernel that links this file, this function takes its place. If the system refuses to start a thread, fewer workers run. */
int do_nothing(RuntimeContext *context) {
  u64 all[16], before[16];
  for (int k = 0; k < 16; k++) all[k] = ~0ULL;
  pthread_sigmask(SIG_SETMASK, all, before); /* workers inherit the mask: Python's own threads receive the signals */
  int started = 0;
  while (started < workers && pthread_create(&thread_of[started], 0, work, (void *)(long)(started + 1)) == 0) started++;
  pthread_sigmask(SIG_SETMASK, before, 0);
  workers = started;
  process = getpid();
  LLVMRuntime_initialize_thread_pool(context->runtime, 0, (char *)parallel_for);
  return started;
}
