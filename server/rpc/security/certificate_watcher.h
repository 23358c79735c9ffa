#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/mutex.h"
#include "server/rpc/security/memory_file.h"
#include "server/rpc/security/tls_files.h"

namespace isomatch {

/// Keeps copies in memory of TLS files, for gRPC's own watcher to look at, and
/// renews them within about a second of a change, but only by files that fit
/// together. (gRPC 1.51 takes whatever it finds, and then refuses every new
/// connection until it finds something better.) Thread-safe.
class CertificateWatcher {
 public:
  /// Called once for each change of the files: OK when they are used now, else
  /// why the ones before are used on. Called from the watcher's thread.
  using OnReload = std::function<void(const absl::Status&)>;

  /// Errors as ReadTlsFiles. REQUIRES: as there.
  static absl::StatusOr<std::unique_ptr<CertificateWatcher>> Start(
      const TlsFiles& files, OnReload on_reload);

  ~CertificateWatcher();

  /// The copies, valid as long as this lives: key with certificates, and the
  /// authorities of clients ("" for none).
  std::string identity_path() const { return identity_.path(); }
  std::string client_ca_path() const;

 private:
  CertificateWatcher(TlsFiles files, OnReload on_reload);

  absl::Status Take(const TlsContent& content);
  void Check();
  /// False when it stops.
  bool WaitForNextCheck();
  void Run();

  const TlsFiles files_;
  const OnReload on_reload_;
  // After Start used by the thread only.
  MemoryFile identity_;
  MemoryFile client_ca_;
  /// What the copies hold, and why the files now do not ("" when they do).
  TlsContent held_;
  std::string problem_;

  Mutex mutex_;
  CondVar stops_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace isomatch
