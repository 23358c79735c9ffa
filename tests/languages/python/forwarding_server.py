"""A server between a client and the real one, which a test can make do things."""

import itertools
from concurrent import futures

import grpc

import isomatch
from isomatch import _messages, _status_messages


class ForwardingServer(grpc.GenericRpcHandler):
    """with ForwardingServer(address) as server: server.address.

    before: by the name of an RPC what is called with the first message of each call, as
      bytes, before that is passed on.
    changed: by the name of an RPC what is called with each of its answers, as bytes, and
      returns what the client gets.
    """

    def __init__(self, address: str) -> None:
        self.before = {}
        self.changed = {}
        self._channel = grpc.insecure_channel(address)
        self._server = grpc.server(futures.ThreadPoolExecutor(8))
        self._server.add_generic_rpc_handlers((self,))
        self.address = "127.0.0.1:{}".format(self._server.add_insecure_port("127.0.0.1:0"))

    def __enter__(self) -> "ForwardingServer":
        self._server.start()
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._server.stop(0)
        self._channel.close()

    def service(self, details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler:
        """On the wire a call with one message is a stream that has one."""
        name = details.method.rpartition("/")[2]
        forward = self._channel.stream_stream(details.method)

        def answers(requests, context):
            first = next(requests)
            self.before.get(name, bytes)(first)
            call = forward(itertools.chain([first], requests))
            context.add_callback(call.cancel)
            try:
                for answer in call:
                    yield self.changed.get(name, bytes)(answer)
            except grpc.RpcError as error:
                context.set_trailing_metadata(error.trailing_metadata())
                context.abort(error.code(), error.details())

        return grpc.stream_stream_rpc_method_handler(answers)

    def take_only_small_requests(self) -> None:
        """So that clients upload meshes that are small as well."""

        def changed(answer):
            response = _messages.GetServerInfoResponse.FromString(answer)
            response.limits.max_request_bytes = 1000
            return response.SerializeToString()

        self.changed["GetServerInfo"] = changed

    def lose_meshes_before_the_first_job(self, other: isomatch.Client) -> list[bytes]:
        """What was uploaded is gone before the first CreateJob is passed on, as when
        another client deletes the last job that named it. Returns a list that grows with
        each CreateJob."""
        requests = []

        def before(request):
            requests.append(request)
            if len(requests) == 1:
                found = _messages.CreateJobRequest.FromString(request)
                found.request_id = "another"
                transport = other._transport
                response = transport.call(transport.rpcs.CreateJob, found)
                job = isomatch.Job(transport, _status_messages.job_status(response.job))
                job.cancel()
                list(job.watch())
                job.delete()

        self.before["CreateJob"] = before
        return requests
