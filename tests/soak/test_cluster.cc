#include "tests/soak/test_cluster.h"

#include <csignal>
#include <filesystem>
#include <utility>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <pqxx/pqxx>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "core/base/file_descriptor.h"

namespace isomatch {
namespace {

/// A port that is free now, and that nobody is given by chance soon.
int FreePort() {
  const FileDescriptor socket(::socket(AF_INET, SOCK_STREAM, 0));
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  EXPECT_EQ(bind(socket.get(), generic, size), 0);
  EXPECT_EQ(getsockname(socket.get(), generic, &size), 0);
  return ntohs(address.sin_port);
}

std::string FreeAddress() { return absl::StrCat("127.0.0.1:", FreePort()); }

/// Returns what was started, or fails the test.
template <typename Server>
std::unique_ptr<Server> Started(
    absl::StatusOr<std::unique_ptr<Server>> server) {
  if (server.ok()) return *std::move(server);
  ADD_FAILURE() << server.status();
  return nullptr;
}

std::shared_ptr<grpc::Channel> ChannelTo(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 100);
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(),
                                   arguments);
}

void WaitForConnected(grpc::Channel& channel) {
  EXPECT_TRUE(channel.WaitForConnected(
      absl::ToChronoTime(absl::Now() + absl::Seconds(30))));
}

/// Returns the ID in a line that says that a job SUCCEEDED, or "".
std::string SuccessIn(const std::string& line) {
  const size_t state = line.find(" SUCCEEDED after ");
  const size_t job = line.rfind("job ", state);
  if (state == std::string::npos || job == std::string::npos) return "";
  return line.substr(job + 4, state - job - 4);
}

/// Debian's library that changes what clocks say.
std::string FakeTimeLibrary() {
  for (const auto& entry : std::filesystem::directory_iterator("/usr/lib")) {
    const auto library = entry.path() / "faketime/libfaketimeMT.so.1";
    if (std::filesystem::exists(library)) return library;
  }
  ADD_FAILURE() << "no libfaketimeMT.so.1: install the Debian package "
                   "libfaketime (docker/packages.txt)";
  return "";
}

}  // namespace

TestCluster::TestCluster(Options options)
    : options_(std::move(options)),
      database_(Started(PostgresServer::Start())) {
  if (way() == Way::kBouncer) bouncer_ = Started(PgBouncer::Start(*database_));
  if (way() == Way::kProxies) {
    proxies_.push_back(std::make_unique<DatabaseProxy>(database_->socket()));
  }
  Migrate(options_.binary);
  for (int i = 0; i < options_.gateways; ++i) AddGateway(options_.binary);
  for (int i = 0; i < options_.workers; ++i) AddWorker(options_.binary);
}

TestCluster::~TestCluster() = default;

std::string TestCluster::StoreOfGateways() const {
  if (way() == Way::kBouncer) return bouncer_->url();
  if (way() == Way::kProxies) return StoreBehind(*proxies_.front());
  return database_->url();
}

std::string TestCluster::StoreOfNextWorker() {
  if (way() != Way::kProxies) return StoreOfGateways();
  proxies_.push_back(std::make_unique<DatabaseProxy>(database_->socket()));
  return StoreBehind(*proxies_.back());
}

std::string TestCluster::StoreBehind(const DatabaseProxy& proxy) const {
  return absl::StrCat("postgresql://isomatch@127.0.0.1:", proxy.port(),
                      "/isomatch");
}

void TestCluster::Migrate(const std::string& binary) {
  ChildProcess migrate(binary, {"migrate", "--store", StoreOfGateways()},
                       "/dev/null");
  EXPECT_EQ(migrate.ExitStatus(), 0);
}

void TestCluster::AddGateway(const std::string& binary) {
  const std::string address = FreeAddress();
  Member& member = gateways_.emplace_back();
  member = {.binary = binary,
            .flags = {"--store", StoreOfGateways(), "--role", "gateway",
                      "--listen", address},
            .metrics = options_.metrics ? FreeAddress() : "off",
            .address = address};
  member.channel = ChannelTo(address);
  member.stub = v1::CorrespondenceService::NewStub(member.channel);
  Start(member);
}

void TestCluster::AddWorker(const std::string& binary) {
  const size_t index = workers_.size();
  Member& member = workers_.emplace_back();
  member = {.binary = binary,
            .flags = {"--store", StoreOfNextWorker(), "--role", "worker",
                      "--threads-per-job", "1"},
            .metrics = options_.metrics ? FreeAddress() : "off"};
  if (index < options_.clocks.size()) member.clock = options_.clocks[index];
  Start(member);
}

void TestCluster::Start(Member& member) const {
  std::string binary = member.binary;
  std::vector<std::string> arguments;
  if (!member.clock.empty()) {
    binary = "/usr/bin/env";
    // With the system's heap: ours asks what time it is before there is an
    // answer.
    arguments = {
        "LD_PRELOAD=" + FakeTimeLibrary() + ":libstdc++.so.6:libc.so.6",
        "FAKETIME=" + member.clock, "FAKETIME_DONT_FAKE_MONOTONIC=1",
        member.binary};
  }
  arguments.insert(arguments.end(), {"--metrics-listen", member.metrics});
  const auto& all = options_.flags;
  arguments.insert(arguments.end(), member.flags.begin(), member.flags.end());
  arguments.insert(arguments.end(), all.begin(), all.end());
  member.process = std::make_unique<LoggedProcess>(binary, arguments);
  if (member.channel == nullptr) return;
  WaitForConnected(*ChannelTo(member.address));
  WaitForConnected(*member.channel);  // by now it knows of an end before
}

void TestCluster::End(Member& member, int signal) {
  for (const std::string& line : member.process->End(signal)) {
    const std::string id = SuccessIn(line);
    if (!id.empty()) ++successes_[id];
  }
  member.process = nullptr;
}

std::string TestCluster::addresses() const {
  return absl::StrJoin(gateways_, ",",
                       [](std::string* text, const Member& gateway) {
                         absl::StrAppend(text, gateway.address);
                       });
}

void TestCluster::KillGateway(int gateway, int signal) {
  End(At(gateways_, gateway), signal);
  Start(At(gateways_, gateway));
}

void TestCluster::KillWorker(int worker, int signal) {
  End(At(workers_, worker), signal);
  Start(At(workers_, worker));
}

void TestCluster::StartAgain() {
  for (auto* const members : {&gateways_, &workers_}) {
    for (Member& member : *members) {
      if (member.process == nullptr || !member.process->HasEnded()) continue;
      End(member, SIGKILL);
      Start(member);
    }
  }
}

void TestCluster::RemoveGateway(int gateway) {
  End(At(gateways_, gateway), SIGTERM);
}

void TestCluster::RemoveWorker(int worker) {
  End(At(workers_, worker), SIGTERM);
}

void TestCluster::SignalWorker(int worker, int signal) {
  At(workers_, worker).process->Signal(signal);
}

void TestCluster::KillDatabase() {
  database_->Kill();
  const absl::Status restarted = database_->Restart();
  EXPECT_TRUE(restarted.ok()) << restarted;
  WaitForStore();
}

void TestCluster::KillBouncer() {
  const absl::Status restarted = bouncer_->Restart();
  EXPECT_TRUE(restarted.ok()) << restarted;
  WaitForStore();
}

void TestCluster::WaitForStore() const {
  const absl::Time deadline = absl::Now() + absl::Seconds(30);
  while (absl::Now() < deadline) {
    try {
      pqxx::connection connection(StoreOfGateways());
      pqxx::nontransaction(connection).exec("SELECT 1");
      return;
    } catch (const pqxx::failure&) {
      absl::SleepFor(absl::Milliseconds(20));
    }
  }
  ADD_FAILURE() << "the database does not come back";
}

void TestCluster::CutConnections() {
  for (const auto& proxy : proxies_) proxy->CutAll();
  if (!proxies_.empty()) return;
  Ask("SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity "
      "WHERE application_name = 'isomatch' AND pid <> pg_backend_pid()");
}

void TestCluster::SetProxies(DatabaseProxy::Mode mode) {
  for (const auto& proxy : proxies_) proxy->Set(mode);
}

std::string TestCluster::Ask(const std::string& sql) const {
  try {
    pqxx::connection connection(database_->url());
    pqxx::nontransaction database(connection);
    const pqxx::result rows = database.exec(sql);
    return rows.empty() ? "" : rows[0][0].as<std::string>("");
  } catch (const pqxx::failure& error) {
    ADD_FAILURE() << sql << ": " << error.what();
    return "";
  }
}

const std::map<std::string, int>& TestCluster::EndWorkers() {
  for (Member& worker : workers_) {
    if (worker.process != nullptr) End(worker, SIGTERM);
  }
  return successes_;
}

}  // namespace isomatch
