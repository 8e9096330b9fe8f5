/* Reference sender of SmartMill's frames (docs/daq.md) in C99, for a little-endian computer: sines of 1 V by TCP to whoever
   connects on the loopback interface.

   cc -O2 -o send_samples send_samples.c -lm
   ./send_samples PORT RATE CHANNELS SECONDS PPM     e.g. 5045 51200 6 10 0; PORT 0: any free one */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <netinet/tcp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { HEADER = 56, FLOAT32 = 3, MOST_CHANNELS = 64, PIECES = 200 };

/* Writes the header of a frame of 32-bit volts. */
static void write_header(unsigned char* at, int channels, uint32_t samples, uint64_t first_index, double rate) {
  const uint32_t payload = samples * (uint32_t)channels * 4;
  memset(at, 0, HEADER);
  memcpy(at, "SMD1", 4);
  at[4] = FLOAT32;
  at[5] = (unsigned char)channels;
  memcpy(at + 8, &samples, 4);
  memcpy(at + 12, &payload, 4);
  memcpy(at + 16, &first_index, 8);
  /* 24: time [ns] of the first sample since 1970, 0: not stated */
  memcpy(at + 32, &rate, 8);
  /* 40, 48: one bit per channel: overloaded, fault of the IEPE supply */
}

static int send_all(int to, const unsigned char* bytes, size_t size) {
  while (size > 0) {
    const ssize_t sent = send(to, bytes, size, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return 0;
    bytes += sent;
    size -= (size_t)sent;
  }
  return 1;
}

int main(int argc, char** argv) {
  if (argc != 6) {
    fprintf(stderr, "usage: send_samples PORT RATE CHANNELS SECONDS PPM\n");
    return 2;
  }
  const double rate = atof(argv[2]), seconds = atof(argv[4]), true_rate = rate * (1.0 + 1e-6 * atof(argv[5]));
  const int channels = atoi(argv[3]);
  const uint32_t samples = (uint32_t)(0.005 * rate);
  if (channels < 1 || channels > MOST_CHANNELS || samples < 1) {
    fprintf(stderr, "send_samples: 1 to 64 channels and 200 samples per second or more expected\n");
    return 2;
  }
  /* A second of samples: 200 pieces, after which the sines of 100 Hz, 200 Hz, ... repeat. */
  const size_t piece = (size_t)samples * (size_t)channels;
  float* volts = malloc(PIECES * piece * sizeof *volts);
  unsigned char* frame = malloc(HEADER + piece * sizeof *volts);
  if (!volts || !frame) return 1;
  for (uint32_t i = 0; i < PIECES * samples; ++i)
    for (int c = 0; c < channels; ++c)
      volts[(size_t)i * (size_t)channels + (size_t)c] = (float)sin(6.283185307179586 * 100.0 * (c + 1) * i / rate);

  const int listener = socket(AF_INET, SOCK_STREAM, 0), on = 1;
  struct sockaddr_in address;
  memset(&address, 0, sizeof address);
  address.sin_family = AF_INET;
  address.sin_port = htons((uint16_t)atoi(argv[1]));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  socklen_t size = sizeof address;
  if (bind(listener, (struct sockaddr*)&address, sizeof address) != 0 || listen(listener, 1) != 0 ||
      getsockname(listener, (struct sockaddr*)&address, &size) != 0) {
    perror("send_samples");
    return 1;
  }
  printf("listening on %d\n", ntohs(address.sin_port));
  fflush(stdout);
  const int to = accept(listener, NULL, NULL);
  setsockopt(to, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);

  struct timespec begin;
  clock_gettime(CLOCK_MONOTONIC, &begin);
  uint64_t index = 0;
  while ((double)index < seconds * rate) {
    const double due = (double)(index + samples) / true_rate; /* the last sample is complete */
    struct timespec at = begin;
    at.tv_sec += (time_t)due;
    at.tv_nsec += (long)(1e9 * (due - floor(due)));
    if (at.tv_nsec >= 1000000000L) {
      at.tv_nsec -= 1000000000L;
      ++at.tv_sec;
    }
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) {
    }
    write_header(frame, channels, samples, index, rate);
    memcpy(frame + HEADER, volts + (index / samples % PIECES) * piece, piece * sizeof *volts);
    if (!send_all(to, frame, HEADER + piece * sizeof *volts)) break;
    index += samples;
  }
  printf("%llu samples sent\n", (unsigned long long)index);
  close(to);
  return 0;
}
