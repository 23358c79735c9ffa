#include "server/rpc/security/certificate_watcher.h"

#include <chrono>
#include <utility>

#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr std::chrono::seconds kPeriod(1);

}  // namespace

CertificateWatcher::CertificateWatcher(TlsFiles files, OnReload on_reload)
    : files_(std::move(files)), on_reload_(std::move(on_reload)) {}

absl::StatusOr<std::unique_ptr<CertificateWatcher>> CertificateWatcher::Start(
    const TlsFiles& files, OnReload on_reload) {
  ISOMATCH_ASSIGN_OR_RETURN(const TlsContent content, ReadTlsFiles(files));
  std::unique_ptr<CertificateWatcher> watcher(
      new CertificateWatcher(files, std::move(on_reload)));
  ISOMATCH_RETURN_IF_ERROR(watcher->Take(content));
  watcher->thread_ = std::thread([self = watcher.get()] { self->Run(); });
  return watcher;
}

CertificateWatcher::~CertificateWatcher() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
  }
  stops_.NotifyAll();
  if (thread_.joinable()) thread_.join();
}

std::string CertificateWatcher::client_ca_path() const {
  return files_.client_ca.empty() ? "" : client_ca_.path();
}

absl::Status CertificateWatcher::Take(const TlsContent& content) {
  ISOMATCH_RETURN_IF_ERROR(identity_.Replace(content.identity_pem));
  ISOMATCH_RETURN_IF_ERROR(client_ca_.Replace(content.client_ca_pem));
  held_ = content;
  return absl::OkStatus();
}

void CertificateWatcher::Check() {
  const absl::StatusOr<TlsContent> content = ReadTlsFiles(files_);
  absl::Status status = content.status();
  const bool changed =
      content.ok() && (content->identity_pem != held_.identity_pem ||
                       content->client_ca_pem != held_.client_ca_pem);
  if (changed) status = Take(*content);
  const bool news = changed || status.message() != problem_;
  problem_ = std::string(status.message());
  if (news && on_reload_) on_reload_(status);
}

bool CertificateWatcher::WaitForNextCheck() {
  const auto next = std::chrono::steady_clock::now() + kPeriod;
  MutexLock lock(mutex_);
  while (!stopping_ && stops_.WaitUntil(mutex_, next)) {
  }
  return !stopping_;
}

void CertificateWatcher::Run() {
  while (WaitForNextCheck()) Check();
}

}  // namespace isomatch
