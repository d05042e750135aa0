/* Threads that share a kernel's loops, in place of Taichi's own (worker_threads.py has them installed; tools/make/assemble_bitcode.py
   makes the .bc beside this file, which is what Taichi reads).

   A loop is a number of blocks. `ticket` says in one word which loop it is and how many of its blocks nobody has taken; each
   thread, the calling one too, takes the next by a compare-and-swap, which fails where that loop has ended meanwhile. */

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

static u32 posted;                /* loops so far: the word that workers wait for */
static u32 done;                  /* blocks of this loop: the word that the caller waits for */
static u32 asleep, caller_asleep; /* how many have gone to sleep over each */
static u32 busy, leaving;
static u64 ticket;
static struct {
  Task *task;
  char *context;
  int blocks;
} loop;
static u64 thread_of[MOST];
static int workers, process;
static long long patience; /* ns of looking before going to sleep */

static long long now(void) {
  long long time[2];
  clock_gettime(CLOCK_MONOTONIC, time);
  return time[0] * 1000000000 + time[1];
}

/* Until *word is no longer `value`. */
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
  /* One who changes the word looks for sleepers after that, one who sleeps looks at the word after it said so: none is missed. */
  __atomic_add_fetch(sleepers, 1, __ATOMIC_SEQ_CST);
  while (__atomic_load_n(word, __ATOMIC_SEQ_CST) == value) syscall(SYS_FUTEX, word, FUTEX_WAIT_PRIVATE, value, 0, 0, 0);
  __atomic_sub_fetch(sleepers, 1, __ATOMIC_SEQ_CST);
}

static void wake(u32 *word, int most) { syscall(SYS_FUTEX, word, FUTEX_WAKE_PRIVATE, most, 0, 0, 0); }

/* Blocks of the loop for this thread, until none is left. */
static void share(int thread) {
  u64 seen = __atomic_load_n(&ticket, __ATOMIC_ACQUIRE);
  while ((u32)seen != 0) {
    /* The loop cannot change while a block of it is left, so these belong to `seen` if the exchange succeeds. */
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
  while (!__atomic_load_n(&leaving, __ATOMIC_ACQUIRE)) {
    await(&posted, seen, &asleep);
    seen = __atomic_load_n(&posted, __ATOMIC_ACQUIRE);
    share(thread);
  }
  return 0;
}

/* What kernels call for each parallel loop. `threads` is what they were compiled for, no more than the processors: of more that
   were hired one that sleeps is as good as another, so all take part. */
static void parallel_for(char *pool, int blocks, int threads, char *context, Task *task) {
  (void)pool, (void)threads;
  if (blocks <= 1 || workers == 0 || __atomic_exchange_n(&busy, 1, __ATOMIC_ACQUIRE)) {
    for (int k = 0; k < blocks; k++) task(context, 0, k); /* also where two threads of Python launch at once */
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

/* Ends the workers; loops go on, on the calling thread alone. A forked process has none. */
static void leave(void) {
  if (process != getpid()) return;
  __atomic_store_n(&leaving, 1, __ATOMIC_RELEASE);
  __atomic_add_fetch(&posted, 1, __ATOMIC_SEQ_CST);
  wake(&posted, MOST);
  for (int k = 0; k < workers; k++) pthread_join(thread_of[k], 0);
  workers = 0;
}

/* Called by a kernel before `do_nothing`, which alone is given the context. */
void prepare(int *wanted, int *nanoseconds, long long *address_of_leave) {
  workers = *wanted < MOST ? *wanted : MOST;
  patience = *nanoseconds;
  *address_of_leave = (long long)leave;
}

/* A function of Taichi's own, for tests of it, whose place this one takes in the kernel: hires and installs. */
int do_nothing(RuntimeContext *context) {
  u64 all[16], before[16];
  for (int k = 0; k < 16; k++) all[k] = ~0ULL;
  pthread_sigmask(SIG_SETMASK, all, before); /* signals are for Python's threads */
  int hired = 0;
  while (hired < workers && pthread_create(&thread_of[hired], 0, work, (void *)(long)(hired + 1)) == 0) hired++;
  pthread_sigmask(SIG_SETMASK, before, 0);
  workers = hired;
  process = getpid();
  LLVMRuntime_initialize_thread_pool(context->runtime, 0, (char *)parallel_for);
  return hired;
}
