/* The functions of a kernel that steps a motion for a host. */

unsigned long vs_kernel_size(void) {
  return sizeof(vs_host);
}
void vs_kernel_begin(void* h, const vs_numbers* numbers) {
  vs_host* const host = h;
  memset(host, 0, sizeof *host);
  host->model.series[0].numbers = host->model.series[1].numbers = host->seen.numbers = numbers;
  vs_host_prepare(host);
}
int vs_kernel_host_begin(void* h, const vs_exchange* from) {
  return vs_host_begin(h, from);
}
void vs_kernel_host_leave(void* h, vs_exchange* to) {
  vs_host_leave(h, to);
}
int vs_kernel_host_step(void* h, double left, vs_exchange* to) {
  return vs_host_step(h, left, to);
}
int vs_kernel_host_cut(void* h, double at) {
  return vs_host_cut(h, at);
}
int vs_kernel_host_change(void* h, vs_exchange* from) {
  return vs_host_change(h, from);
}
int vs_kernel_host_see(void* h, double at, vs_seen* to) {
  return vs_host_see(h, at, to);
}
double vs_kernel_host_work(void* h, double at, double* through) {
  return vs_host_work(h, at, through);
}
void vs_kernel_host_look(void* h, double at, double* entry) {
  vs_host_look(h, at, entry);
}
